"""What was driven, in words: systems, robot, simulator, worlds, statistics and versions, from records alone.

The words cite lme and the paper that it implements; `bibtex` returns `CITATION.cff` as BibTeX.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from lme.errors import InputError
from lme.inputs.guarded_file import read_yaml
from lme.inputs.resources import citation_file
from lme.robots import Cap, Robot
from runners.config.catalogue import Catalogue
from runners.config.changes import describe_changes
from runners.config.escaping import counted, latex_text
from runners.config.instantiate import fill_dataclass
from runners.config.job import scale_in_words
from runners.records.launch_record import Launch, versions
from runners.reports.analysis import paired
from runners.reports.analysis.summary import DASH, as_text

if TYPE_CHECKING:
    import pandas as pd

SOFTWARE, PAPER = "lme-software", "lme-paper"  # what \cite calls them
LIBRARIES = ("numpy", "numba", "scipy", "pandas", "pyarrow", "matplotlib", "hydra-core")
_MOST_SPANS = 12  # of numbers of worlds
_MOST_SYSTEMS = 12
_DRAWN = "drawn"  # instead of the name of a robot that every episode draws


def paragraphs(frame: pd.DataFrame, launches: Sequence[Launch], compared: bool) -> list[str]:
    """Return the paragraphs of a methods section.

    frame: the records. launches: the launch records of their runs, of those that have one. compared: whether runs are
    compared with each other. A citation is written as [@KEY].
    """
    return [
        " ".join(sentences)
        for sentences in (
            _systems(frame, launches),
            _robots(frame, launches),
            [*_simulators(frame, launches), *_worlds(frame, launches), *_crowds(frame, launches)],
            _statistics(frame, compared),
            _software(launches),
        )
        if sentences
    ]


def _systems(frame: pd.DataFrame, launches: Sequence[Launch]) -> list[str]:
    """Return a sentence for each system with its parts, and with whatever differs from its shipped options."""
    labels = list(dict.fromkeys(as_text(frame["system"])))
    sentences = [f"We drove {_listed(labels)} in simulation [@{SOFTWARE}]."]
    if any("LME" in label for label in labels) or any(
        launch.choices[0].get("guide") == "lme" for launch in launches
    ):
        sentences.append(f"LME is the Local-Minimum Escaper [@{PAPER}].")
    shared = _shared_changes(launches)
    details = dict.fromkeys(f"{_system(frame, launch)} {_parts(launch, shared)}." for launch in launches)
    sentences += list(details)[:_MOST_SYSTEMS]
    if len(details) > _MOST_SYSTEMS:
        sentences.append(f"{len(details) - _MOST_SYSTEMS} more configurations are in the table of results.")
    if shared:
        sentences.append(f"Every run was driven with {describe_changes(shared)}.")
    return sentences + _weights(launches)


def _system(frame: pd.DataFrame, launch: Launch) -> str:
    """Return the name of the system of a run."""
    return str(frame["system"][frame["run_dir"] == str(launch.directory)].iloc[0])


def _weights(launches: Sequence[Launch]) -> list[str]:
    """Return the parameters of each weight set that a complete system drove with, unscaled."""
    values = {}
    for launch in launches:
        parameters = _node(launch, "guide").get("parameters")
        is_complete = not (_node(launch, "ablation") or _node(launch, "scale"))
        if launch.weights and isinstance(parameters, dict) and parameters and is_complete:
            values[launch.weights[0]] = ", ".join(
                f"{name} = {_number(value)}" for name, value in parameters.items()
            )
    return [f"The weight set {name} is {text}." for name, text in values.items()]


def _shared_changes(launches: Sequence[Launch]) -> dict[str, Any]:
    """Return the changed keys, such as those of the map, that all runs share if there are several."""
    changes = [launch.changes[0] for launch in launches]
    if len(changes) < 2:
        return {}
    return {
        key: value
        for key, value in changes[0].items()
        if all((key, value) in changes_of_run.items() for changes_of_run in changes)
    }


def _own_changes(launch: Launch, shared: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in launch.changes[0].items() if key not in shared}


def _parts(launch: Launch, shared: Mapping[str, Any]) -> str:
    """Return guide, planner, weights, and what differs from the shipped options, as the predicate of a sentence.

    shared: changed keys that are not named here.
    """
    choices, changes = launch.choices[0], _own_changes(launch, shared)
    guide, planner = (choices.get(group, "?") for group in ("guide", "planner"))
    words = [f"is the guide {guide} with the planner {planner}"]
    if _node(launch, "guide").get("parameters") and launch.weights:
        words.append(f"the weight set {launch.weights[0]}")
    if choices.get("ablation", "none") != "none":
        words.append(f"the ablation {choices['ablation']}")
    if choices.get("filter", "none") != "none":
        words.append(f"the filter {choices['filter']}")
    if scale := scale_in_words(_node(launch, "scale")):
        words.append(f"factors on its parameters ({scale})")
    if changes:
        words.append(f"the changed keys {describe_changes(changes)}")
    return _listed(words)


def _robots(frame: pd.DataFrame, launches: Sequence[Launch]) -> list[str]:
    """Return what each robot is and may do. Raises InputError for a launch record that describes none."""
    if "robot" in frame and _DRAWN in set(frame["robot"]):
        return ["Every episode draws its robot; the records hold its size and limits."]
    texts = []
    for launch in launches:
        robot: Robot = fill_dataclass(Robot, _node(launch, "robot"), "robot")
        cap: Cap = fill_dataclass(Cap, _node(launch, "cap"), "cap")
        texts.append(_robot(robot, cap))
    return _whose(frame, launches, texts)


def _whose(frame: pd.DataFrame, launches: Sequence[Launch], texts: Sequence[str]) -> list[str]:
    """Return each different text once, with the systems that it is about if there are several. texts: by launch."""
    systems: dict[str, dict[str, None]] = {}
    shared = _shared_changes(launches)
    for launch, text in zip(launches, texts, strict=True):
        own = describe_changes(_own_changes(launch, shared))
        changes = f" ({own})" if own else ""
        systems.setdefault(text, {})[f"{_system(frame, launch)}{changes}"] = None
    if len(systems) < 2:
        return list(systems)
    return [f"For {_listed(names)}: {text}" for text, names in systems.items()]


def _robot(robot: Robot, cap: Cap) -> str:
    footprint, lidar = robot.footprint, robot.lidar
    shape = (
        f"a disc with a radius of {footprint.radius:g} m"
        if footprint.radius is not None
        else f"a rectangle of {footprint.length:g} m by {footprint.width:g} m (inner radius "
        f"{footprint.inscribed_radius:.3g} m, outer radius {footprint.circumscribed_radius:.3g} m)"
    )
    caps = [
        f"{limit:g} {unit}"
        for limit, unit in ((cap.v_max, "m/s"), (cap.omega_max, "rad/s"))
        if limit is not None
    ]
    limited = f"Commands are limited to {_listed(caps)}. " if caps else ""
    turned = f", turned by {math.degrees(lidar.yaw):.0f}°" if lidar.yaw else ""
    x, y, _ = lidar.sensor
    mounted = f", mounted at ({x:g} m, {y:g} m){turned}," if any(lidar.sensor) else ""
    return (
        f"The robot {robot.name} is {shape}, and LME plans with a radius of {robot.r:.3g} m. It drives at up to "
        f"{robot.v_max:g} m/s and {robot.omega_max:g} rad/s, with up to {robot.alpha_v:g} m/s² and "
        f"{robot.alpha_omega:g} rad/s², and is controlled at {robot.control_rate:g} Hz. "
        f"{limited}Its lidar{mounted} takes {lidar.num_beams} ranges over {math.degrees(lidar.fov):.0f}°, "
        f"from {lidar.range_min:g} m to {lidar.range_max:g} m, with Gaussian noise of {lidar.noise_std:g} m."
    )


def _simulators(frame: pd.DataFrame, launches: Sequence[Launch]) -> list[str]:
    return _whose(frame, launches, [f"The simulator is lme's {_simulator(launch)}." for launch in launches])


def _simulator(launch: Launch) -> str:
    """Return the simulator's option, and what its file says it is, without references to lme's pages."""
    option, catalogue = launch.choices[0].get("sim", "?"), Catalogue(launch.folders)
    if option not in catalogue.options("sim"):
        return option
    return f"{option} ({re.sub(r' [(](docs|research)/.*[)]', '', catalogue.title(f'sim/{option}'))})"


def _worlds(frame: pd.DataFrame, launches: Sequence[Launch]) -> list[str]:
    """Return the worlds of each map set with their counts, the seeds, and how an episode ends."""
    columns = [column for column in ("map", "subset") if column in frame]
    texts = frame.assign(**{column: as_text(frame[column]) for column in columns})
    sentences = []
    for values, group in texts.groupby(columns, sort=False):
        name, subset = (*values, "")[:2]
        worlds, runs = sorted(map(int, group["world"].unique())), int(group["run"].nunique())
        spans = _spans(worlds)
        shown = (
            ", ".join(spans)
            if len(spans) <= _MOST_SPANS
            else f"{len(spans)} spans from {worlds[0]} to {worlds[-1]}"
        )
        sentences.append(
            f"The map set is {name}{f' ({subset})' if subset else ''}, {counted(len(worlds), 'world')} ({shown}), with "
            f"{counted(runs, 'run')} of each configuration in each: {counted(len(group), 'episode')} in all."
        )
        nodes = [
            _node(launch, "map") for launch in launches if str(launch.directory) in set(group["run_dir"])
        ]
        limits = [node["time_limit"] for node in nodes if "time_limit" in node]
        sentences += _endings(group, limits)
    seeds = sorted({int(seed) for seed in frame["seed"].dropna()}) if "seed" in frame else []
    if seeds:
        sentences.append(
            f"An episode draws its random numbers from the seed ({_listed(list(map(str, seeds)))}), its world and the "
            "number of its run."
        )
    return sentences


def _crowds(frame: pd.DataFrame, launches: Sequence[Launch]) -> list[str]:
    """Return who is added to the worlds; [] if that is nobody in all runs."""
    if not any(_node(launch, "crowd") for launch in launches):
        return []
    return _whose(frame, launches, list(map(_crowd, launches)))


def _crowd(launch: Launch) -> str:
    keys = {key: value for key, value in _node(launch, "crowd").items() if not key.startswith("_")}
    if not keys:
        return "Nobody is added to the worlds."
    crowd = launch.choices[0].get("crowd", "?")
    return f"The people of the crowd {crowd} are added to every world ({describe_changes(keys)})."


def _endings(group: pd.DataFrame, limits: Sequence[Any]) -> list[str]:
    """Return how episodes of a map set end. limits: their time limits [s]; None for one that the path decides."""
    tolerances = sorted(group["goal_tolerance_m"].dropna().unique()) if "goal_tolerance_m" in group else []
    if not tolerances:
        return []
    goal = _listed([f"{tolerance:g}" for tolerance in tolerances], "or")
    times = dict.fromkeys(
        "a time that grows with the length of the shortest path" if limit is None else f"{_number(limit)} s"
        for limit in limits
    )
    ends = [f"within {goal} m of the goal", "on contact with anything"]
    return [f"An episode ends {_listed([*ends, *(f'after {time}' for time in times)], 'or')}."]


def _statistics(frame: pd.DataFrame, compared: bool) -> list[str]:
    several_runs = frame["run"].nunique() > 1
    sentences = ["The standard deviation (±) is over runs."] if several_runs else []
    sentences.append(
        "Success rates have 95 % Wilson intervals, with worlds, not runs, as independent samples."
    )
    if compared:
        sentences += [
            paired.NOTES[0],
            f"Their 95 % intervals are percentiles of {paired.RESAMPLES:,} bootstrap resamples of the worlds.",
            f"Their p-values come from sign-flip permutation tests over worlds, with all flips or {paired.RESAMPLES:,} "
            "random ones, and are adjusted by Holm over all differences in one measure; below "
            f"{paired.LEVEL:g}, a difference counts as beyond the noise.",
        ]
    return sentences


def _software(launches: Sequence[Launch]) -> list[str]:
    codes = list(dict.fromkeys(launch.code for launch in launches if launch.code))
    days = sorted({launch.started[:10] for launch in launches if launch.started})
    span = " to ".join(dict.fromkeys(days[:1] + days[-1:]))
    sentences = (
        [f"The episodes were driven by {_listed(codes)}{f' on {span}' if span else ''}."] if codes else []
    )
    names = versions(*LIBRARIES)
    tools = ", ".join(f"{name} {version}" for name, version in names.items())
    return [*sentences, f"Tables and figures were made with {tools}."]


def _node(launch: Launch, group: str) -> dict[str, Any]:
    """Return the values of a group in the recorded config; {} where there are none."""
    node = launch.configs[0].get(group)
    return node if isinstance(node, dict) else {}


def _spans(numbers: Sequence[int]) -> list[str]:
    """Return increasing numbers as spans: "0–3", "7"."""
    spans: list[list[int]] = []
    for number in numbers:
        if spans and number == spans[-1][-1] + 1:
            spans[-1].append(number)
        else:
            spans.append([number])
    return [str(span[0]) if len(span) == 1 else f"{span[0]}{DASH}{span[-1]}" for span in spans]


def _number(value: Any) -> str:
    return f"{value:g}" if isinstance(value, int | float) else str(value)


def _listed(texts: Iterable[str], last: str = "and") -> str:
    """Return "a", "a and b", or "a, b and c"."""
    *first, final = texts
    return f"{', '.join(first)} {last} {final}" if first else final


def bibtex() -> str:
    """Return the entries of the software and of the paper. Raises InputError if CITATION.cff cannot be read."""
    citation = read_yaml(citation_file())
    if not isinstance(citation, dict) or not citation.get("references"):
        raise InputError(f"{citation_file()}: is damaged: lme must be installed again")
    return "\n".join([_bibtex_entry(SOFTWARE, citation), _bibtex_entry(PAPER, citation["references"][0])])


def _bibtex_entry(key: str, work: Mapping[str, Any]) -> str:
    """Return a `@misc`, the one kind of entry that needs neither a journal nor a year."""
    released = str(work.get("date-released", ""))
    fields = {
        "author": " and ".join(map(_author, work["authors"])),
        "title": f"{{{latex_text(str(work['title']))}}}",
        "year": str(work.get("year") or released[:4]),
        "note": f"Version {work['version']}" if "version" in work else "",
        "howpublished": "Software" if work.get("type") == "software" else "",
    }
    lines = [f"  {name} = {{{value}}}," for name, value in fields.items() if value]
    return "\n".join([f"@misc{{{key},", *lines, "}", ""])


def _author(author: Mapping[str, str]) -> str:
    """Return a person as "Family, Given", and a group in braces, which keep it whole."""
    if "family-names" in author:
        return latex_text(f"{author['family-names']}, {author['given-names']}")
    return f"{{{latex_text(author['name'])}}}"
