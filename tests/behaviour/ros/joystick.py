"""Drives for a while and then falls silent: `python -m tests.behaviour.ros.joystick 1|2`.

Prints the greatest speed of the odometry while it drove, and the last one after a second of silence [m/s].
"""

import json
import sys
import time

from lme.types import Twist
from runners.ros.outgoing import OutgoingMessages
from runners.ros.run import connect
from runners.ros.transport import Delivery


def main():
    ros, speeds = connect(int(sys.argv[1]), "joystick", ()), []
    make = OutgoingMessages(ros)
    send = ros.publisher("cmd_vel", "geometry_msgs/Twist")
    ros.subscribe(
        "odom", "nav_msgs/Odometry", lambda m: speeds.append(m.twist.twist.linear.x), Delivery.NEWEST
    )
    while not (speeds and send.watched):
        ros.handle(0.1)
    pushed = time.monotonic()
    while (since := time.monotonic() - pushed) < 2.0:
        ros.handle(0.05)
        if since < 1.0:
            send(make.command("Twist", 0, "base_link", Twist(0.2, 0.0)))
    print(json.dumps({"fastest": max(speeds), "last": speeds[-1]}), flush=True)
    ros.close()


if __name__ == "__main__":
    main()
