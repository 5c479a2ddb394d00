"""Every reader of data: how a good input is made, and what reads it.

`write` fills an empty folder with good files, of which one will be damaged. `read` reads that folder. It may return, or
raise InputError with one line; a command may also print such a line and end with a status. Nothing else is right.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml
from PIL import Image

from lme.config.presets import load_settings
from lme.errors import InputError
from lme.inputs.resources import resource_dir
from tests import made_bags, made_logs, networks, torch_archives
from tests.lme.worlds.barn.test_files import write_world
from tests.torture import command_lines
from tests.torture.mutations import Rng, spoil

DRIVE = ["eval", "map.worlds=[0]", "runs=2", "executor=serial", "tracking=none", "hydra.run.dir=run"]
TRAIN = [
    "train", "map=barn", "training_numbers=[0,20]", "trials=2", "configurations=1", "search=random", "runs=1",
    "race=null", "held_out={}", "map.worlds=[30]", "executor=serial", "tracking=none", "hydra.run.dir=run",
]  # fmt: skip
SIZE_M = (10.0, 8.0)


class Reader(NamedTuple):
    """share: of the inputs; slow readers have less. spoil: how a good input is damaged. needs: a module; or none.

    of_files: whether the damage may be another one.
    """

    name: str
    write: Callable[[Path], None]
    read: Callable[[Path], object]
    share: float = 1.0
    spoil: Callable[[Rng, Path], None] = spoil
    needs: str | None = None
    of_files: bool = True


def command(*words: str) -> None:
    """A command of lme in this process. Raises AssertionError where it prints a traceback or ends oddly."""
    from runners.cli.main import main

    said = io.StringIO()
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
        try:
            status = main(list(words))
        except SystemExit as end:  # argparse's
            status = end.code
    if status not in (0, 1, 2) or "Traceback" in said.getvalue():
        raise AssertionError(f"lme {words}: status {status}: {said.getvalue()[-2000:]}")
    if status:
        raise InputError(said.getvalue().strip().splitlines()[-1])


def _world(folder: Path) -> None:
    file = write_world(folder, 42)
    file.write_text(file.read_text()[:3000] + file.read_text()[3000:])


def _read_world(folder: Path) -> None:
    from lme.worlds.barn.map_set import Barn

    maps = Barn(load_settings("map/barn", source=str(folder), subset="all"))
    for number in maps.numbers:
        maps.task(number)


def _picture(folder: Path, name: str) -> Path:
    pixels = np.full((40, 50), 255, np.uint8)
    pixels[5:9, 10:20] = 0
    Image.fromarray(pixels).save(folder / name)
    return folder / name


def _pictures(folder: Path) -> None:
    for name in ("a.png", "b.pgm", "c.jpg", "d.gif", "e.bmp", "f.tiff"):
        _picture(folder, name)


def _read_pictures(folder: Path) -> None:
    from lme.worlds.bitmap import read_bitmap

    for path in sorted(folder.iterdir()):
        read_bitmap(path, SIZE_M)


def _ros_map(folder: Path) -> None:
    _picture(folder, "map.pgm")
    about = {"image": "map.pgm", "resolution": 0.2, "origin": [0.0, 0.0, 0.0], "negate": 0}
    (folder / "map.yaml").write_text(yaml.safe_dump({**about, "occupied_thresh": 0.65, "free_thresh": 0.196}))


def _read_ros_map(folder: Path) -> None:
    _own_map(folder / "map.yaml")


def _own_map(path: Path) -> None:
    from lme.worlds.room import MapFile

    maps = MapFile(load_settings("map/file", path=str(path), configurations=2, grid=0.2))
    for number in maps.numbers:
        maps.task(number)


def _shapes(folder: Path) -> None:
    shapes = {
        "bounds": [0, 0, 10, 8],
        "boxes": [{"centre": [2, 3], "size": [0.4, 0.2], "yaw_deg": 30}],
        "polygons": [{"points": [[5, 5], [5.5, 5], [5.2, 5.6]]}],
        "circles": [{"centre": [7, 2], "radius": 0.1}],
        "ellipses": [{"centre": [7, 4], "size": [0.3, 0.5], "yaw_deg": 0}],
        "walls": [{"points": [[0, 7], [3, 7], [3, 7.5]], "thickness": 0.03}],
    }
    (folder / "shapes.yaml").write_text(yaml.safe_dump(shapes))


def _read_shapes(folder: Path) -> None:
    _own_map(folder / "shapes.yaml")


def _scene(folder: Path) -> None:
    for name in ("real1_dynamic", "go2_a"):
        shutil.copy(resource_dir("maps") / "scenes" / f"{name}.yaml", folder)


def _read_scene(folder: Path) -> None:
    from lme.worlds.scene import Scene

    for path in sorted(folder.iterdir()):
        Scene(load_settings("map/_scene", path=str(path), worlds=[0], grid=0.2)).task(0)


def _weights(folder: Path) -> None:
    shutil.copy(resource_dir("conf") / "weight_set" / "published.yaml", folder / "weights.yaml")


def _read_weights(folder: Path) -> None:
    from lme.config.presets import load_parameters

    load_parameters(folder / "weights.yaml")


def _robot(folder: Path) -> None:
    shutil.copy(resource_dir("conf") / "robot" / "go2.yaml", folder / "robot.yaml")


def _read_robot(folder: Path) -> None:
    from lme.config.presets import load_robot

    load_robot(folder / "robot.yaml")


def _networks(folder: Path) -> None:
    networks.network_file(folder / "dclp.onnx")
    networks.drl_vo_file(folder / "drl_vo.onnx")


def _read_networks(folder: Path) -> None:
    from lme.inputs.onnx_file import SignedNetwork
    from lme.inputs.onnx_graph import read_weights
    from lme.planners.dclp.weights import SIGNATURE
    from lme.planners.drl_vo.weights import SIGNATURE as DRL_VO

    SignedNetwork(folder / "dclp.onnx", SIGNATURE)
    SignedNetwork(folder / "drl_vo.onnx", DRL_VO)
    read_weights(folder / "dclp.onnx", SIGNATURE.what)


def _checkpoint(folder: Path) -> None:
    networks.checkpoint(folder / "model", networks.random_weights())


def _read_checkpoint(folder: Path) -> None:
    from lme.planners.dclp.importing import import_checkpoint

    import_checkpoint(folder / "model")


def _archive(folder: Path) -> None:
    torch_archives.archive(folder / "drl_vo.zip", networks.random_drl_vo())


def _read_archive(folder: Path) -> None:
    from lme.planners.drl_vo.importing import import_archive

    import_archive(folder / "drl_vo.zip")


def _spoil_archive(rng: Rng, folder: Path) -> None:
    """Damage the zip, or the pickle or the numbers in the zip that it holds, with right checksums."""
    if rng.random() < 0.3:
        return spoil(rng, folder)
    path = folder / "drl_vo.zip"
    with zipfile.ZipFile(path) as outer:
        members = {name: outer.read(name) for name in outer.namelist()}
    with zipfile.ZipFile(io.BytesIO(members["policy.pth"])) as inner:
        parts = {name: inner.read(name) for name in inner.namelist()}
    inside = folder / "part"
    pickles = [name for name in parts if name.endswith("data.pkl")]
    name = pickles[0] if rng.random() < 0.8 else str(rng.choice(list(parts)))
    for unpacked in folder.iterdir():
        unpacked.unlink()
    inside.write_bytes(parts[name])
    spoil(rng, folder)
    parts[name] = inside.read_bytes()
    inside.unlink()
    members["policy.pth"] = torch_archives.zipped(parts)
    path.write_bytes(torch_archives.zipped(members))
    return None


def _bag(suffix: str) -> Callable[[Path], None]:
    def write(folder: Path) -> None:
        made = made_bags.drive(suffix, steps=8, beams=24).write(folder)
        made.rename(folder / f"drive{suffix}")
        shutil.rmtree(folder / "drive", ignore_errors=True)

    return write


def _read_bag(folder: Path) -> None:
    (path,) = folder.iterdir()
    shutil.rmtree(folder.parent / "replayed", ignore_errors=True)
    command("replay", str(path), "tracking=none", f"hydra.run.dir={folder.parent / 'replayed'}", "horizon=1")


def _look_at_bag(folder: Path) -> None:
    """The part of a replay that reads: topics, frames, clock and every message."""
    from lme.live.frames import FramesConfig
    from runners.recordings.bags import Bag
    from runners.recordings.own_recordings import episode_of
    from runners.recordings.recording import inspect
    from runners.recordings.topics import BagTopicsConfig, choose, table

    (path,) = folder.iterdir()
    with Bag(path) as bag:
        table(bag)
        episode_of(bag)
        topics = choose(bag, BagTopicsConfig(), None)
        recording = inspect(bag, topics, FramesConfig(), "auto")
        recording.last_pose(None)
        for message in bag.messages(topics.names):
            recording.pose(message, recording.tree)


def _carmen(folder: Path) -> None:
    made_logs.write(folder / "a.log", made_logs.flaser_lines(made_logs.way()[:6], beams=31))
    made_logs.write(folder / "b.log.gz", made_logs.robotlaser_lines(beams=31)[:6])


def _map_logs(folder: Path) -> None:
    """Maps of each log, as `lme maps build` makes them."""
    from runners.recordings.map_build import BuildConfig, build_map

    for path in sorted(folder.iterdir()):
        build_map([path], BuildConfig(resolution=0.1, max_range=5.0), shown=False)


def _driven(folder: Path) -> None:
    """A finished run and one that was stopped before the records were merged."""
    _in(folder, DRIVE)
    shutil.rmtree(folder / "run" / ".hydra")
    for path in (folder / "run").iterdir():
        if path.suffix not in (".parquet", ".json"):
            path.unlink()


def _in(folder: Path, words: list[str]) -> None:
    before = Path.cwd()
    os.chdir(folder)
    try:
        command(*words)
    finally:
        os.chdir(before)


def _read_records(folder: Path) -> None:
    from runners.records.records import find_runs, read_episodes, read_trajectories
    from runners.reports.analysis.summary import summarise

    runs = find_runs([folder / "run"])
    summarise(read_episodes(runs))
    read_trajectories(runs)


def _tabulate(folder: Path) -> None:
    command("table", str(folder / "run"))


def _explain(folder: Path) -> None:
    command("explain", str(folder / "run"))
    command("explain", str(folder / "run"), "0", "--text")


def _launch(folder: Path) -> None:
    _driven(folder)
    for path in (folder / "run").glob("*.parquet"):
        path.rename(folder.parent / f"{path.name}.aside")


def _resume(folder: Path) -> None:
    command("eval", f"resume={folder / 'run'}", "--cfg", "job")


def _log(folder: Path) -> None:
    from lme.navigation.episode import TRAJECTORY_COLUMNS
    from runners.records.episode_record import EpisodeResult, encode, entry_of
    from tests.builders import episode_record

    rng = np.random.default_rng(0)
    results = (
        EpisodeResult(episode_record(world, 0), rng.normal(size=(5, len(TRAJECTORY_COLUMNS))))
        for world in range(4)
    )
    lines = [encode(entry_of(result)) for result in results]
    (folder / "run" / "parts").mkdir(parents=True)
    (folder / "run" / "parts" / "episodes.jsonl").write_bytes(b"".join(lines))


def _read_log(folder: Path) -> None:
    from runners.records.records import RecordWriter

    _read_records(folder)
    with RecordWriter(folder / "run") as writer:
        writer.done()
        writer.merge()
    _read_records(folder)


def _study(folder: Path) -> None:
    _in(folder, TRAIN)
    (folder / "run" / "study.journal").rename(folder / "study.journal")
    shutil.rmtree(folder / "run")
    shutil.rmtree(folder / "outputs")


def _read_study(folder: Path) -> None:
    from runners.config.instantiate import build as build_target
    from runners.config.space import read_space
    from runners.records.launch_record import identity
    from runners.training.families import families
    from runners.training.search import check_configurations, open_study, world_numbers
    from tests.composing import jobs_of

    with jobs_of("train") as job_of:
        job = job_of(*TRAIN[1:])
    config = job.config
    search = build_target(config.search, "search")
    study = open_study(None, None, folder, identity(config), read_space(config), search, {})
    trained = families(config, job.choices)
    check_configurations(study, trained, world_numbers(job, trained)[0], folder)
    _ = study.finished_trials, study.num_finished, study.best
    study.importances()


def _scores(folder: Path) -> None:
    lines = [json.dumps([{"a": 1.0, "b": k}, [["success", 1.0, 2.0]]]) for k in range(5)]
    (folder / "scores.jsonl").write_text("".join(f"{line}\n" for line in lines))


def _read_scores(folder: Path) -> None:
    from runners.training.race_log import ScoreLog

    ScoreLog(folder / "scores.jsonl").get({"a": 1.0, "b": 2})


def _learning(folder: Path) -> Any:
    """A training of a network, before it has done anything."""
    from runners.learning.run import Run
    from runners.workers.progress import LearnProgress
    from tests.composing import jobs_of

    with jobs_of("learn") as job_of:
        config = job_of().config
    return Run(config, folder, None, lambda items, what="": iter(()), LearnProgress("torture", 1))


def _learned(folder: Path) -> None:
    import torch

    run = _learning(folder)
    optimiser = torch.optim.Adam(run.network.parameters())
    run.save_checkpoint(1, None, {"rounds": 1, "optimiser": optimiser.state_dict()})


def _read_learned(folder: Path) -> None:
    import torch

    run = _learning(folder)
    optimiser = torch.optim.Adam(run.network.parameters())
    run.restore(lambda state: optimiser.load_state_dict(state["optimiser"]))


def _lessons(folder: Path) -> None:
    np.savez(
        folder / "round_000.npz",
        feature_0=np.zeros((9, 6, 90), np.float32),
        feature_1=np.zeros((9, 8), np.float32),
        actions=np.zeros((9, 2), np.float32),
        outcomes=np.array([[1, 4], [0, 5]], np.float32),
    )


def _read_lessons(folder: Path) -> None:
    from runners.learning.clone_training import _read

    _read(folder / "round_000.npz")


def _own_options(folder: Path) -> None:
    for group, name in (("system", "lme"), ("robot", "jackal"), ("map", "barn"), ("planner", "dwa")):
        (folder / group).mkdir()
        shutil.copy(resource_dir("conf") / group / f"{name}.yaml", folder / group / "mine.yaml")


def _read_own_options(folder: Path) -> None:
    from runners.evaluate.evaluate import validate
    from tests.composing import jobs_of

    words = ("robot=mine", "map=mine", "planner=mine", "tracking=none")
    with jobs_of("eval", config_dir=folder) as job_of:
        validate(job_of(*words))


def _gazebo(folder: Path) -> None:
    (folder / "log.txt").write_text("".join(f"{world} 1 0 0 9.5 0.5\n" for world in range(9)))


def _read_gazebo(folder: Path) -> None:
    from benchmarks.gazebo_logs import read_log

    read_log(folder / "log.txt")


READERS = (
    Reader("BARN worlds and paths", _world, _read_world),
    Reader("pictures", _pictures, _read_pictures),
    Reader("ROS maps", _ros_map, _read_ros_map),
    Reader("shape files", _shapes, _read_shapes),
    Reader("scenes", _scene, _read_scene, share=0.5),
    Reader("weight files", _weights, _read_weights),
    Reader("robots", _robot, _read_robot),
    Reader("networks", _networks, _read_networks, share=0.5),
    Reader("TensorFlow checkpoints", _checkpoint, _read_checkpoint, share=0.5),
    Reader("Stable-Baselines3 archives", _archive, _read_archive, spoil=_spoil_archive),
    Reader("recordings .bag", _bag(".bag"), _look_at_bag, share=2.0),
    Reader("recordings .db3", _bag(".db3"), _look_at_bag, share=2.0),
    Reader("recordings .mcap", _bag(".mcap"), _look_at_bag, share=2.0),
    Reader("CARMEN logs", _carmen, _map_logs),
    Reader("maps from recordings", _bag(".mcap"), _map_logs, share=0.2),
    Reader("lme replay", _bag(".mcap"), _read_bag, share=0.02),
    Reader("records", _driven, _read_records),
    Reader("lme table", _driven, _tabulate, share=0.02),
    Reader("lme explain", _driven, _explain, share=0.05),
    Reader("append logs", _log, _read_log),
    Reader("launch.json", _launch, _resume, share=0.2),
    Reader("studies", _study, _read_study, share=0.2),
    Reader("scores of trials", _scores, _read_scores),
    Reader("checkpoints of lme learn", _learned, _read_learned, share=0.2, needs="torch"),
    Reader("lessons of lme learn", _lessons, _read_lessons, needs="torch"),
    Reader("own options", _own_options, _read_own_options, 0.2),
    Reader("Gazebo logs", _gazebo, _read_gazebo),
    Reader("overrides", command_lines.write, command_lines.compose, 0.3, command_lines.vary, of_files=False),
    Reader(
        "command lines",
        command_lines.write,
        command_lines.run,
        0.1,
        command_lines.vary_command,
        of_files=False,
    ),
)
