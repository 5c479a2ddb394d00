"""A client of the navigation action: `python -m tests.behaviour.ros.client 1|2 X Y [SECONDS]`.

Sends a goal, cancels it after SECONDS if they are given, and prints the final state and the number of feedbacks.
"""

import json
import sys
import time

from runners.ros.run import connect


def main():
    version, x, y, *cancel = map(float, sys.argv[1:])
    ros = connect(int(version), "client", ())
    pose = ros.type("geometry_msgs/PoseStamped")()
    pose.header.frame_id, pose.pose.position.x, pose.pose.position.y = "odom", x, y
    state, feedbacks = {1: drive1, 2: drive2}[int(version)](ros, pose, *cancel)
    print(json.dumps({"state": state, "feedbacks": feedbacks}), flush=True)
    ros.close()


def drive1(_, pose, cancel=None):
    import actionlib
    from actionlib_msgs.msg import GoalStatus
    from move_base_msgs.msg import MoveBaseAction, MoveBaseGoal

    client, heard = actionlib.SimpleActionClient("move_base", MoveBaseAction), []
    client.wait_for_server()
    client.send_goal(MoveBaseGoal(target_pose=pose), feedback_cb=heard.append)
    if cancel is not None:
        time.sleep(cancel)
        client.cancel_goal()
    client.wait_for_result()
    return GoalStatus.to_string(client.get_state()).lower(), len(heard)


def drive2(ros, pose, cancel=None):
    from action_msgs.msg import GoalStatus
    from nav2_msgs.action import NavigateToPose
    from rclpy.action import ActionClient

    node, heard = ros._node, []
    client = ActionClient(node, NavigateToPose, "navigate_to_pose")
    client.wait_for_server()
    sent = client.send_goal_async(NavigateToPose.Goal(pose=pose), feedback_callback=heard.append)
    while not sent.done():
        ros.handle(0.1)
    ending = sent.result().get_result_async()
    since = time.monotonic()
    while not ending.done():
        ros.handle(0.1)
        if cancel is not None and time.monotonic() - since > cancel:
            sent.result().cancel_goal_async()
            cancel = None
    names = {GoalStatus.STATUS_SUCCEEDED: "succeeded", GoalStatus.STATUS_CANCELED: "canceled"}
    return names.get(ending.result().status, "aborted"), len(heard)


if __name__ == "__main__":
    main()
