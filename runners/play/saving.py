"""Files that the page saves below the folder where `lme play` started: maps, records, pages, films, recordings.

A drawn world becomes a shape file, which `lme eval map=file map.path=FILE` drives. The changes of a session in a
changing world are in `play.json` beside its record.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml

from lme.errors import InputError
from lme.inputs.guarded_file import read_json
from lme.navigation.episode import Episode
from lme.types import Floats, Pose
from lme.worlds.world import Task, World
from runners.config.command_line import compose_job
from runners.config.composer import Composer
from runners.config.quoting import lme_command, override
from runners.play.drawing import KINDS, Sketch, item_of
from runners.play.session import Script, Session
from runners.play.simulation_track import SimulationTrack, trajectory_of
from runners.records import inputs
from runners.records.atomic_write import write_atomically
from runners.records.episode_record import EpisodeKey, EpisodeResult
from runners.records.launch_record import identity, launch_of, trust_flags
from runners.workers.trace import Drive, Trace, TracedStep, TraceEnd

FOLDER = Path("outputs/play")
_NAME = re.compile(r"[A-Za-z0-9][\w-]{0,59}")
_GIF_WIDTH, _GIF_FPS = 800, 10.0
SCRIPT = "play.json"
_BORDER = 0.5  # [m] around a world that has no outer wall
_SIDES = 4


class Saved(NamedTuple):
    """A saved file or directory, relative to the folder, and the command that uses it."""

    path: Path
    command: str


def save(session: Session, kind: str, name: str, root: Path, step: int) -> Saved:
    """Save a file of the given kind under a name, with a number added if the name is taken.

    step: the one whose world is saved, for a map. Raises InputError.
    """
    if not _NAME.fullmatch(name):
        raise InputError(f"name is {name!r:.70}: must be letters, digits, - and _, at most 60")
    folder = root / FOLDER
    try:
        folder.mkdir(parents=True, exist_ok=True)
        saved = SAVERS[kind](session, _Destination(root, folder, name), step)
    except OSError as error:
        raise InputError(
            f"{folder}: cannot be written ({error.strerror or error}): free some space there"
        ) from error
    return saved


class _Destination(NamedTuple):
    """The folder and the name to write to. root: the folder that displayed paths are relative to."""

    root: Path
    folder: Path
    name: str

    def free(self, suffix: str) -> Path:
        """Return a path that does not exist yet."""
        stems = (self.name if number == 1 else f"{self.name}-{number}" for number in count(1))
        return next(path for path in (self.folder / f"{stem}{suffix}" for stem in stems) if not path.exists())

    def shown(self, path: Path) -> Path:
        """Return the path as the user would type it."""
        return path.relative_to(self.root)


def _save_map(session: Session, destination: _Destination, step: int) -> Saved:
    path = destination.free(".yaml")
    write_atomically(path, shape_file(session.script.at(step), f"{path.stem}: drawn with lme play"))
    return Saved(
        destination.shown(path),
        lme_command("eval", "map=file", override("map.path", destination.shown(path))),
    )


def _save_record(session: Session, destination: _Destination, step: int) -> Saved:
    """Save the drive of the first lane as a run's directory.

    If the world did not change meanwhile, the drive is repeated and recorded as by `lme eval`; otherwise `play.json`
    holds the changes.
    """
    lane, script = _ended(session), session.script
    setup, run_dir = script.setup, destination.free("")
    words = list(setup.systems[0].words)
    # A drawing that stayed as it was is saved as a map of its own, which lme eval can drive.
    has_drawing = script.drawings[0].touched or script.begin is not None
    run_dir.mkdir()
    if has_drawing and not script.changed:
        begin = (
            script.drawings[0] if script.begin is None else replace(script.drawings[0], start=script.begin)
        )
        write_atomically(run_dir / "world.yaml", shape_file(begin, f"{run_dir.name}: drawn with lme play"))
        words = _in_file(
            words, destination.shown(run_dir / "world.yaml"), script.drawings[0].base, destination.name
        )
    else:
        words.append(f"map.worlds=[{setup.task.number}]")
    # Write the run, and return the command that plays its episode.
    world = 0 if has_drawing and not script.changed else setup.task.number
    _write_run(session, lane, run_dir, [*words, f"runs={setup.run + 1}"], EpisodeKey(world, setup.run))
    words = [f"{world}/{setup.run}", *trust_flags(run_dir)]
    return Saved(destination.shown(run_dir), lme_command("play", destination.shown(run_dir), *words))


def _in_file(words: list[str], path: Path, base: Task, name: str) -> list[str]:
    """Return words that drive in a shape file by the rules of the world in which it was drawn."""
    other_words = [word for word in words if word.partition("=")[0].partition(".")[0] not in ("map", "crowd")]
    rules = {key: float(getattr(base, key)) for key in ("goal_tolerance", "time_limit", "clock_distance")}
    goal_rules = [f"map.{key}={value!r}" for key, value in rules.items()]
    return [*other_words, "map=file", override("map.path", path), override("map.name", name), *goal_rules]


def _write_run(
    session: Session, lane: SimulationTrack, run_dir: Path, words: list[str], key: EpisodeKey
) -> None:
    from runners.config import build
    from runners.evaluate.evaluate import run_labels
    from runners.records.records import RecordWriter
    from runners.workers.episodes import EpisodePayload, initialise, record_of

    script = session.script
    source = script.setup.source
    if source is None:
        raise InputError(
            "a recording does not say by which words it was made: save it as a page or a recording"
        )
    # Compose the config from the words, as a user of the command line would.
    with Composer("eval", source.config_dir) as composer:
        job = compose_job(composer, ["tracking=none", *words])
    # Record the drive as it was if the world changed, else drive it again and compare.
    was_changed = script.changed
    if was_changed:
        write_script(script, run_dir / SCRIPT)
        labels, episode = script.setup.systems[0].labels, _episode(lane)
        assert isinstance(episode, Episode)
        record = record_of(labels, key, script.setup.seed, session.tasks[max(session.tasks)], episode, 0.0)
        result = EpisodeResult(record, episode.trajectory)
    else:
        # The words do not have the label that the user gave the system.
        name = script.setup.systems[0].labels.system
        labels = replace(run_labels(job, build.map_set(job.config, [key.world])), system=name)
        result = initialise(EpisodePayload(job.config, labels, None))(key)
        if not np.array_equal(result.trajectory[:, :4], [frame.row[:4] for frame in lane.frames]):
            raise InputError(
                f"{run_dir.name}: lme eval drives otherwise there: save it as a page or a recording"
            )
    # Write the launch record, copies of the input files, and the records.
    launch = launch_of("play" if was_changed else "eval", [job], words, False, None)
    launch.write(run_dir)
    inputs.keep(launch.inputs, run_dir)
    with RecordWriter(run_dir) as writer:
        writer.append(result)
        writer.merge()


def _save_page(session: Session, destination: _Destination, step: int) -> Saved:
    from runners.reports.explainer.write import write_page

    path = destination.free(".html")
    write_page(trace_of(session, _ended(session, False)), path, session.lanes[0].label)
    return Saved(destination.shown(path), f"open {destination.shown(path)} in a browser")


def _save_gif(session: Session, destination: _Destination, step: int) -> Saved:
    from runners.reports.figures.animation import Screen, write_film
    from runners.reports.figures.video import pace_of

    path = destination.free(".gif")
    traces = [trace_of(session, lane) for lane in session.lanes]
    pace, speed = pace_of(traces, None, _GIF_FPS)
    note = "" if speed == 1.0 else f"{speed:.3g}× real time"
    screen = Screen(traces, [lane.label for lane in session.lanes], _GIF_WIDTH, candidates=False, note=note)
    write_film(screen.pictures(pace.held), path, pace.fps, screen.sample(pace.times))
    return Saved(destination.shown(path), f"open {destination.shown(path)}")


def _save_mcap(session: Session, destination: _Destination, step: int) -> Saved:
    """Save the messages of the first lane; in a changed world, they do not claim that lme eval can repeat them."""
    from runners.workers.mcap_episodes import Recorder

    lane, setup, path = session.lanes[0], session.script.setup, destination.free(".mcap")
    # Only an untouched world can be named, and so be driven again.
    metadata: dict[str, object] = {"played": True}
    if not (session.script.changed or session.script.drawings[0].touched or session.script.begin):
        record_keys = {"seed": setup.seed, "world": setup.task.number, "run": setup.run}
        metadata = {**record_keys, "config": identity(lane.config)}
    with Recorder(path, metadata, lane.config.robot) as recorder:
        for moment, state in ((frame.moment, frame.state) for frame in lane.frames):
            if isinstance(moment, TracedStep):
                recorder.decided(moment.observation, moment.guidance, moment.command, state)
            else:
                recorder.ended(moment.observation, state)
    return Saved(destination.shown(path), lme_command("replay", destination.shown(path), "as_recorded=false"))


SAVERS: Mapping[str, Callable[[Session, _Destination, int], Saved]] = {
    "map": _save_map,
    "record": _save_record,
    "page": _save_page,
    "gif": _save_gif,
    "mcap": _save_mcap,
}


def trace_of(session: Session, lane: SimulationTrack) -> Trace:
    """Return the drive of a lane so far as a trace, as the explainer page and films take it."""
    setup, config = session.script.setup, lane.config
    steps, end = _steps(lane), lane.frames[-1].moment
    if isinstance(end, TracedStep):
        end = TraceEnd(end.time, end.pose, end.observation, end.obstacles)
    # In a changing world, nothing is drawn as static.
    task = session.tasks[0]
    if session.script.changed:
        task = replace(task, world=World(), goal=session.tasks[max(session.tasks)].goal)  # all of it may move
    return Trace(config, setup.task.number, setup.run, config.robot, task, tuple(steps), end, _episode(lane))


def _steps(lane: SimulationTrack) -> list[TracedStep]:
    """Return all decisions except one that was not executed."""
    frames = lane.frames if lane.outcome is not None else lane.frames[:-1]
    return [frame.moment for frame in frames if isinstance(frame.moment, TracedStep)]


def _episode(lane: SimulationTrack) -> Episode | Drive:
    """Return the finished episode, or what is known of a drive that has not ended."""
    episode = lane.episode()
    if episode is not None:
        return episode
    rows = trajectory_of(lane.frames)
    for row, step in zip(rows, _steps(lane), strict=False):
        row[6:9] = *step.subgoal, step.guidance.switched
    return Drive("given up", float(rows[-1, 0]), rows)


def _ended(session: Session, must: bool = True) -> SimulationTrack:
    """Return the first lane. Raises InputError if its drive must have ended but has not."""
    lane = session.lanes[0]
    if must and lane.outcome is None:
        raise InputError("the drive has not ended: a record needs its outcome; let it drive to the end")
    return lane


def write_script(script: Script, path: Path) -> None:
    """Write the drawings by step, and where the drive begins."""
    drawings = {step: _to_mapping(drawing) for step, drawing in sorted(script.drawings.items())}
    if script.begin is not None:
        drawings[0]["start"] = list(script.begin)
    write_atomically(path, json.dumps({"drawings": drawings}, indent=1) + "\n")


def read_script(path: Path, task: Task) -> Mapping[int, Sketch]:
    """Read the drawings by step, on a task. Raises InputError for a damaged file."""
    try:
        drawings = read_json(path)["drawings"]
        sketches = {int(step): _sketch(task, mapping) for step, mapping in drawings.items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{path}: is damaged ({error}): the changes of this drive are lost") from error
    if 0 not in sketches:
        raise InputError(f"{path}: is damaged (no drawing at step 0): the changes of this drive are lost")
    return sketches


def _to_mapping(drawing: Sketch) -> dict[str, Any]:
    items = {name: {"kind": item.kind, "entry": item.entry} for name, item in drawing.items.items()}
    return {
        "start": list(drawing.start),
        "goal": list(drawing.goal),
        "erased": sorted(drawing.erased),
        "items": items,
    }


def _sketch(task: Task, entry: Mapping[str, Any]) -> Sketch:
    x, y = map(float, entry["goal"])
    items = {name: item_of(item["kind"], item["entry"]) for name, item in entry["items"].items()}
    start = Pose(*map(float, entry["start"]))
    return replace(Sketch.of(task), start=start, goal=(x, y), erased=frozenset(entry["erased"]), items=items)


def shape_file(drawing: Sketch, title: str) -> str:
    """Return the YAML of a drawing with its start and goal. A world without an outer wall gets one."""
    bounds, wall = _bounds(drawing)
    lines = [f"# {title}", f"bounds: {_flow(bounds)}"]
    drawn_items = [item for name, item in drawing.parts() if name not in wall]
    for kind in KINDS:
        entries = [item.entry for item in drawn_items if item.kind == kind]
        lines += [f"{kind}:"] if entries else []
        lines += [f"  - {_flow(entry)}" for entry in entries]
    lines += [
        f"start: {_flow(list(drawing.start))}  # x, y [m], yaw [rad]",
        f"goal: {_flow(list(drawing.goal))}  # [m]",
    ]
    return "\n".join(lines) + "\n"


def _bounds(drawing: Sketch) -> tuple[list[float], set[str]]:
    """Return the bounds, and the names of the walls along them, which every shape file has anyway."""
    # Use the outer wall of the base if all four sides are still there.
    segments = drawing.base.world.segments[:_SIDES]
    names = {f"s{i}" for i in range(_SIDES)}
    if len(segments) == _SIDES and not names & drawing.erased and _is_outline(segments):
        low, high = segments[:, :2].min(axis=0), segments[:, :2].max(axis=0)
        return [*low.tolist(), *high.tolist()], names
    # Else put bounds around everything, rounded outwards to whole metres.
    points = _extent(drawing)
    low, high = points.min(axis=0) - _BORDER, points.max(axis=0) + _BORDER
    return [*(math.floor(low) for low in low.tolist()), *(math.ceil(high) for high in high.tolist())], set()


def _is_outline(segments: Floats) -> bool:
    """Return whether four segments form the closed wall along their bounding box."""
    (x0, y0), (x1, y1) = segments[:, :2].min(axis=0), segments[:, :2].max(axis=0)
    corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
    return bool(np.array_equal(segments, np.hstack([corners, np.roll(corners, -1, axis=0)])))


def _extent(drawing: Sketch) -> Floats:
    """Return points that span everything in the world."""
    from runners.reports.figures.scene import extremes

    world = drawing.world()
    paths = [mover.path[:, :2] for mover in world.movers]
    ends = np.array([drawing.start[:2], drawing.goal])
    return np.vstack([extremes(world), ends, *paths])


def _flow(value: Any) -> str:
    """Return a value on one line, with all its digits."""
    container = list(value) if isinstance(value, list) else dict(value)
    return yaml.safe_dump(container, default_flow_style=True, sort_keys=False, width=math.inf).strip()
