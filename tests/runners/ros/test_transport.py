"""What the connections to ROS do without ROS."""

import queue

from runners.ros.ros1 import Ros1


def test_messages_without_end_do_not_hold_up_the_node():
    ros = Ros1.__new__(Ros1)  # without a master
    ros._inbox = queue.SimpleQueue()
    taken = []

    def flood():
        taken.append(1)
        ros._inbox.put(flood)

    flood()
    ros.handle(0.0)
    assert len(taken) > 10
