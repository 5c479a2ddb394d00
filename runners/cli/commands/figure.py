"""Draw a figure, of episodes driven for it or of a run's records: lme figure KIND …"""

from __future__ import annotations

from runners.config.quoting import key_of

EXAMPLES = (
    "lme figure trajectories -m system=dwa_tuned,lme_dwa_tuned,lme world=250",
    "lme figure features world=250 step=40",
    "lme figure robot figure.robots=[jackal,go2]",
    "lme figure video run=outputs/eval/RUN world=250",
    "lme figure experiment=barn_trajectories",
)
_BESIDE_RUN = {"run", "world", "formats", "figure", "experiment", "resume"}  # keys that say what to draw
_DRIVES_NOTHING = {  # kinds, each with where it takes what it draws from
    "maps": "the maps are those of figure.maps, e.g. figure.maps=['env1 3 radius=0.2']",
    "robot": "it draws the robot of robot=, or those of figure.robots, e.g. figure.robots=[jackal,go2]",
}
_SHORT = {"map.world": "world", "step": "figure.step", "moment": "figure.moment"}


def main(argv: list[str]) -> int:
    """Compose the config, drive what must be driven, and draw. `lme figure KIND` stands for `figure=KIND`."""
    from runners.cli.launch import Command, launch
    from runners.evaluate.figure import draw_sweep, figure, validate

    words = _to_overrides(argv)
    _check_driving(words)
    _check_swept(words)
    return launch(Command("figure", figure, validate, draw_sweep), words)


def _to_overrides(argv: list[str]) -> list[str]:
    """Return the words as overrides: the kind, short names in full, and a single format as a list."""
    words = list(argv)
    if words and "=" not in words[0] and not words[0].startswith("-"):
        words[0] = f"figure={words[0]}"
    for number, word in enumerate(words):
        key, value = key_of(word), word.partition("=")[2]
        if key == "formats" and value.isalpha():
            words[number] = f"formats=[{value}]"
        elif key in _SHORT:
            words[number] = f"{_SHORT[key]}={value}"
    return words


def _check_driving(words: list[str]) -> None:
    """Raise InputError for a key that says what to drive if the figure only draws recorded episodes, maps or robots."""
    from lme.errors import InputError
    from runners.config import catalogue

    words_by_key = {key_of(word): word for word in words if "=" in word}
    kind = words_by_key.get("figure", "").partition("=")[2]
    if kind in _DRIVES_NOTHING:
        reason = f"figure={kind} drives nothing; {_DRIVES_NOTHING[kind]}"
        if {"-m", "--multirun"} & set(words):
            raise InputError(f"-m: {reason}; omit it")
    elif not words_by_key.get("run", "run=null").endswith("=null"):
        reason = "the episodes of run= were driven with its own config"
    else:
        return
    configs = catalogue.shipped()
    beside = _BESIDE_RUN | {"robot"} if kind == "robot" else _BESIDE_RUN
    driving = {*configs.groups("figure"), *(key.name for key in configs.keys("figure"))} - beside
    for key, word in words_by_key.items():
        if key.partition(".")[0] in driving:
            raise InputError(f"{word}: {reason}; omit it")


def _check_swept(words: list[str]) -> None:
    """Raise InputError for a sweep over one of the figure's own keys, since a sweep draws a single figure."""
    from lme.errors import InputError

    if not {"-m", "--multirun"} & set(words):
        return
    for word in words:
        key, value = key_of(word), word.partition("=")[2]
        is_single = key.partition(".")[0] in ("run", "world", "formats", "figure")
        if is_single and "," in value and not value.startswith(("[", "'", '"')):
            raise InputError(
                f"{word}: one figure is drawn of all jobs, so this cannot be swept; several worlds are a list, "
                "world=[3,4], and -m sweeps what is driven: systems, maps, ablations"
            )
