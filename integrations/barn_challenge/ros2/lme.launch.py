"""LME for the BARN Challenge in ROS 2: serves the action navigate_to_pose. args: of `lme live ros2`."""

import os
import shlex
from pathlib import Path

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess, OpaqueFunction, Shutdown
from launch.substitutions import LaunchConfiguration

NODE = Path(os.environ.get("LME_PREFIX", "/lme")) / "bin" / "lme_node"
WORDS = "system=lme_plus people=none"


def start(context: LaunchContext) -> list[ExecuteProcess]:
    words = shlex.split(LaunchConfiguration("args").perform(context))
    # Without a node the robot would never move, and the trial would never end.
    stop = Shutdown(reason="lme ended")
    return [ExecuteProcess(cmd=[str(NODE), *words], name="lme", output="screen", on_exit=stop)]


def generate_launch_description() -> LaunchDescription:
    args = DeclareLaunchArgument("args", default_value=WORDS, description="of lme live ros2")
    return LaunchDescription([args, OpaqueFunction(function=start)])
