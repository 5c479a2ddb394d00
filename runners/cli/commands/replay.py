"""Let a guide and a planner decide on what a robot saw, and compare with what it did."""

from __future__ import annotations

EXAMPLES = (
    "lme replay drive.mcap",
    "lme replay drive.bag list=true",
    "lme replay drive.bag robot=go2 guide=lme planner=dwa goal=[6.0,-1.5]",
)


def main(argv: list[str]) -> int:
    """Compose the config and replay; with list=true, print the recording's topics and nothing else.

    A first word without "=" is the recording: `lme replay drive.bag` stands for `bag=drive.bag`.
    """
    from lme.inputs.guarded_file import expanded
    from runners.cli.launch import Command, launch
    from runners.config.quoting import quoted
    from runners.recordings.run import replay, validate

    words = list(argv)
    if words and "=" not in words[0] and not words[0].startswith("-"):
        words[0] = f"bag={quoted(str(expanded(words[0])))}"
    values = dict(word.partition("=")[::2] for word in words)
    if values.get("list", "false").lower() in ("true", "1", "yes", "on"):
        return _list(values.get("bag", "").strip("'\""))
    return launch(Command("replay", replay, validate), words)


def _list(path: str) -> int:
    from lme.errors import InputError
    from lme.inputs.guarded_file import expanded
    from runners.recordings.recording import open_recording
    from runners.recordings.topics import table

    if not path:
        raise InputError("bag is null: give the recording, e.g. lme replay drive.mcap list=true")
    with open_recording(expanded(path)) as bag:
        print(f"{bag.path}: {bag.duration_s:.1f} s")
        print("\n".join(table(bag)))
    return 0
