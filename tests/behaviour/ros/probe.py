"""A robot that stands in the open, in a process of its own: `python -m tests.behaviour.ros.probe 1|2`.

It sends what its sensors see and prints what it is commanded. Lines of JSON on the standard input change it:
{"scan": "good" | "empty" | "nan" | null, "odometry": …, "clock": "real" | "running" | "frozen"}, {"goal": [x, y],
"frame": name}, {"cancel": true}, or {"watch": true}, which shows markers and diagnostics. Every command is a line of
JSON on the standard output, with real time [s].
"""

import json
import math
import os
import select
import sys
import time

import numpy as np

from lme.types import LaserScan, Pose, Twist
from runners.ros.outgoing import OutgoingMessages
from runners.ros.run import connect
from runners.ros.transport import Delivery

_RATE = 20.0  # [Hz] of scans and odometry
_BEAMS, _RANGE = 180, 5.0


class Robot:
    def __init__(self, version):
        self.ros = connect(version, "probe", ())
        self.make = OutgoingMessages(self.ros)
        self.set = {"scan": "good", "odometry": "good", "clock": "real"}
        self.frozen = time.time_ns()
        goal = {1: "move_base_simple/goal", 2: "goal_pose"}[version]
        ros = self.ros
        self.scan = ros.publisher("scan", "sensor_msgs/LaserScan")
        self.odometry = ros.publisher("odom", "nav_msgs/Odometry")
        self.clock = ros.publisher("/clock", "rosgraph_msgs/Clock")
        self.goal = ros.publisher(goal, "geometry_msgs/PoseStamped")
        self.cancel = ros.publisher("lme/cancel", "std_msgs/Empty")
        ros.subscribe("cmd_vel", "geometry_msgs/Twist", self.obey, Delivery.NEWEST)
        ros.subscribe("lme/reason", "std_msgs/String", self.tell, Delivery.NEWEST)

    def obey(self, message):
        say(time=time.monotonic(), v=message.linear.x, omega=message.angular.z)

    def tell(self, message):
        say(time=time.monotonic(), reason=message.data)

    def watch(self):
        ros = self.ros
        ros.subscribe("lme/markers", "visualization_msgs/MarkerArray", self.see, Delivery.NEWEST)
        ros.subscribe("/diagnostics", "diagnostic_msgs/DiagnosticArray", self.diagnose, Delivery.NEWEST)

    def see(self, message):
        found = message.markers[1:]  # the first one deletes those before
        say(groups=sorted({one.ns for one in found}), frame=found[0].header.frame_id)

    def diagnose(self, message):
        (status,) = message.status
        say(status=status.message, values={one.key: one.value for one in status.values})

    def now(self):
        if self.set["clock"] != "frozen":
            self.frozen = time.time_ns()
        return self.frozen

    def sense(self):
        now, make = self.now(), self.make
        if self.set["clock"] == "running" or self.set["clock"] == "frozen":
            self.clock(make.clock(now))
        if self.set["odometry"] is not None:
            x = math.nan if self.set["odometry"] == "nan" else 0.0
            self.odometry(make.odometry(now, "odom", "base_link", Pose(x, x, x), Twist(x, x)))
        if self.set["scan"] is not None:
            ranges = {"good": [_RANGE] * _BEAMS, "nan": [math.nan] * _BEAMS, "empty": []}[self.set["scan"]]
            beams = np.array(ranges, np.float32)
            scan = LaserScan(beams, -math.pi, math.tau / _BEAMS, 0.1, 10.0)
            self.scan(make.scan(now, "base_link", scan, 1.0 / _RATE))

    def change(self, asked):
        self.set.update({key: value for key, value in asked.items() if key in self.set})
        if "goal" in asked:
            pose = Pose(*asked["goal"], 0.0)
            self.goal(self.make.pose(self.now(), asked.get("frame", "odom"), pose))
        if "watch" in asked:
            self.watch()
        if "cancel" in asked:
            self.cancel(self.ros.type("std_msgs/Empty")())


def say(**values):
    print(json.dumps(values), flush=True)


def main():
    robot, due, unread = Robot(int(sys.argv[1])), 0.0, b""
    say(ready=True)
    while True:
        robot.ros.handle(max(due - time.monotonic(), 0.0))
        if time.monotonic() >= due:
            due = time.monotonic() + 1.0 / _RATE
            robot.sense()
        while select.select([sys.stdin], [], [], 0.0)[0]:
            read = os.read(0, 4096)
            if not read:
                return robot.ros.close()
            *lines, unread = (unread + read).split(b"\n")
            for line in lines:
                robot.change(json.loads(line))


if __name__ == "__main__":
    main()
