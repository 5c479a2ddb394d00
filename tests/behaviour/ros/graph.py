"""What a node of ROS 2 reads, sends and serves: `python -m tests.behaviour.ros.graph NODE`, as a line of JSON."""

import json
import sys
import time

import rclpy
from rclpy.action import get_action_server_names_and_types_by_node


def main():
    rclpy.init()
    node, name = rclpy.create_node("graph"), sys.argv[1]
    deadline = time.monotonic() + 60.0
    while name not in node.get_node_names() or not get_action_server_names_and_types_by_node(node, name, "/"):
        assert time.monotonic() < deadline, node.get_node_names()
        rclpy.spin_once(node, timeout_sec=0.1)
    found = {
        "in": node.get_subscriber_names_and_types_by_node(name, "/"),
        "out": node.get_publisher_names_and_types_by_node(name, "/"),
        "action": get_action_server_names_and_types_by_node(node, name, "/"),
    }
    print(json.dumps({key: dict(pairs) for key, pairs in found.items()}), flush=True)
    rclpy.shutdown()


if __name__ == "__main__":
    main()
