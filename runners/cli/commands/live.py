"""Drive a real robot with a guide and a planner over ROS 1 or 2, or play a robot in the simulator."""

from __future__ import annotations

EXAMPLES = (
    "lme live ros1 robot=jackal topics=jackal",
    "lme live ros2 robot=turtlebot2 planner=dwa live.soft_stop=true",
    "lme live simulator --ros2 robot=turtlebot2 map=env1",
    "lme live ros2 robot=turtlebot2 live.use_sim_time=true",
)
_ROS = {"ros1": 1, "ros2": 2}
_SIMULATOR = "simulator"
_FLAGS = {"--ros1": 1, "--ros2": 2}
_PRINTS = ("--cfg", "-c", "--info", "-i", "--hydra-help")  # which run nothing


def main(argv: list[str]) -> int:
    """Run `lme live ros1`, `lme live ros2` or `lme live simulator --ros1`, with overrides and ROS's own arguments.

    Raises InputError for other words.
    """
    from functools import partial

    from runners.cli.launch import Command, launch
    from runners.ros.run import drive, validate

    overrides, arguments = _split(argv)
    command = Command("live", partial(drive, arguments=arguments), validate)
    return launch(command, _to_overrides(overrides))


def _split(argv: list[str]) -> tuple[list[str], list[str]]:
    """Split the words into those for lme and those for ROS: remappings in ROS 1, all after --ros-args in ROS 2."""
    split_index = argv.index("--ros-args") if "--ros-args" in argv else len(argv)
    overrides = [word for word in argv[:split_index] if ":=" not in word]
    return overrides, [*(word for word in argv[:split_index] if ":=" in word), *argv[split_index:]]


def _to_overrides(words: list[str]) -> list[str]:
    """Return the kind and the version of ROS as overrides."""
    from lme.errors import InputError

    if words and words[0].startswith(_PRINTS):
        return words
    kind, options = (words[0], words[1:]) if words else ("", [])
    flags = [word for word in options if word in _FLAGS]
    options = [word for word in options if word not in _FLAGS]
    if kind in _ROS and not flags:
        return [f"live={kind}", f"ros={_ROS[kind]}", *options]
    if kind == _SIMULATOR and len(flags) == 1:
        return [f"live={kind}", f"ros={_FLAGS[flags[0]]}", *options]
    unknown = [] if "=" in kind else [kind]
    shown_words = " ".join(filter(None, [*unknown, *flags]))
    advice = "must be lme live ros1, lme live ros2, or lme live simulator with --ros1 or --ros2"
    raise InputError(f"{shown_words}: {advice}" if shown_words else advice)
