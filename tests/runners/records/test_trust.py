"""A run that somebody else made is data: no command executes what it names without --trust."""

import dataclasses
import json
import shutil
import sys
from types import SimpleNamespace

import pytest

from lme.errors import InputError
from runners.cli.main import main
from runners.play.opening import open_episode
from runners.recordings.own_recordings import episode_of
from runners.records import trust
from runners.records.launch_record import LAUNCH, read_launch
from runners.records.trust import UntrustedError
from tests.composing import jobs_of
from tests.made_runs import write_run

EVIL = "from pathlib import Path\nPath('executed').touch()\nclass Part:\n    pass\n"
COMMANDS = [
    "table RUN",
    "table SWEEP",
    "compare SWEEP",
    "export RUN",
    "export RUN --steps 200",
    "leaderboard RUN",
    "explain RUN 200",
    "explain RUN 200 --text",
    "figure trajectories run=RUN",
    "eval resume=RUN",
]
NAMED = {"map._target_": "evil.Part", "guide.criteria": {"c_evil": "evil.Part"}}  # needed for worlds, and not


def change(run_dir, **changed):
    """Change values of a launch record by dotted key of its config, or by its own name."""
    path = run_dir / LAUNCH
    record = json.loads(path.read_text())
    for key, value in changed.pop("config", {}).items():
        *groups, last = key.split(".")
        node = record["configs"][0]
        for group in groups:
            node = node[group]
        node[last] = value
    path.write_text(json.dumps(record | changed))


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A sweep and a run, without their steps."""
    place = tmp_path_factory.mktemp("made")
    with jobs_of() as job:
        for run_dir in (place / "SWEEP" / "0", place / "SWEEP" / "1", place / "RUN"):
            write_run(run_dir, job=job())
            (run_dir / "trajectories.parquet").unlink()
    return place


@pytest.fixture
def folder(made, tmp_path, monkeypatch):
    """A working folder with these, and with a module that waits to be imported."""
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "evil.py").write_text(EVIL)
    yield tmp_path
    sys.modules.pop("evil", None)


def every_run(folder):
    return [path.parent for path in folder.rglob(LAUNCH)]


def call(capsys, command):
    """What a command says, on both streams, and its status."""
    status = main(command.split())
    said = capsys.readouterr()
    return status, said.out + said.err


@pytest.mark.filterwarnings("ignore:no picture of the paths:UserWarning")
@pytest.mark.parametrize("key", NAMED)
def test_no_command_imports_what_a_run_names(folder, capsys, key):
    for run_dir in every_run(folder):
        change(run_dir, config={key: NAMED[key]}, overrides=[f"{key}=evil.Part"])
    for command in COMMANDS:
        status, said = call(capsys, command)
        needs_records_alone = (
            command.split()[0] in ("table", "compare", "leaderboard") or command == "export RUN"
        )
        assert status == (0 if needs_records_alone else 2), said
        assert needs_records_alone or ("evil.Part" in said and "--trust" in said)
    with pytest.raises(UntrustedError, match=r"evil\.Part.*--trust"):
        open_episode(folder / "RUN", "200", None)
    assert not (folder / "executed").exists()


def test_with_trust_a_run_may_name_code(folder, capsys, says):
    for run_dir in every_run(folder):
        change(run_dir, config={"planner._target_": "evil.Part"})
    status, said = call(capsys, "explain RUN 200 --text --trust")
    assert (folder / "executed").exists()
    assert status == 2
    says(said)


def test_no_secret_of_the_environment_is_shown(folder, capsys, monkeypatch):
    monkeypatch.setenv("LME_SECRET", "hunter2")
    for run_dir in every_run(folder):
        text = "${oc.env:LME_SECRET}"
        change(
            run_dir,
            config={"map.subset": text, "robot.name": text},
            changes=[{"robot.name": text}],
            overrides=[f"robot.name={text}"],
        )
    for command in [*COMMANDS[:4], "explain RUN 200", "explain RUN 200 --trust", "eval resume=RUN"]:
        status, said = call(capsys, command)
        assert "hunter2" not in said
        assert status in (0, 2)
    with pytest.raises(InputError, match="values alone"):
        open_episode(folder / "RUN", "200", None)
    assert not any(b"hunter2" in path.read_bytes() for path in folder.rglob("*") if path.is_file())


@pytest.mark.parametrize(
    "changed",
    [
        {"overrides": ["+hydra.callbacks.evil._target_=evil.Part"]},
        {"overrides": ["hydra/launcher=joblib"]},
        {"overrides": ["hydra.searchpath=[file:///tmp]"]},
        {"overrides": ["planner={_target_: evil.Part}"]},
        {"overrides": ["guide.criteria={x: os.system}"]},
        {"overrides": ["robot=../../../../tmp/evil"]},
        {"overrides": ["map.path=/etc/passwd"]},
        {"overrides": ["seed=${oc.env:HOME}"]},
        {"config_dir": "/tmp"},
        {"config_name": "../evil"},
    ],
)
def test_resume_uses_nothing_else_that_a_foreign_run_names(folder, capsys, changed):
    change(folder / "RUN", **changed)
    status, said = call(capsys, "eval resume=RUN")
    assert status == 2
    assert "--trust" in said
    assert not (folder / "executed").exists()


def test_the_config_in_a_recording_is_checked_too(folder):
    config = read_launch(folder / "RUN").configs[0] | {"planner": {"_target_": "evil.Part"}}
    about = {"seed": 0, "world": 0, "run": 0, "scan": {}, "config": config}
    message = SimpleNamespace(content=SimpleNamespace(data=json.dumps(about)))
    bag = SimpleNamespace(path=folder / "drive.mcap", by_lme=True, messages=lambda names: iter([message]))
    with pytest.raises(UntrustedError, match=r"evil\.Part"):
        episode_of(bag)
    with trust.trusting(None):
        assert episode_of(bag).config.planner == {"_target_": "evil.Part"}


def test_a_file_outside_the_run_is_not_read(folder, tmp_path_factory, capsys):
    outside = tmp_path_factory.mktemp("private") / "hall.yaml"
    outside.write_text("token: hunter2\n")
    change(folder / "RUN", config={"map.path": str(outside)})
    status, said = call(capsys, "explain RUN 200")
    assert status == 2
    assert "holds no copy" in said
    assert "hunter2" not in said


def test_one_knows_ones_own_runs(folder):
    assert read_launch(folder / "RUN").is_own
    change(folder / "RUN", overrides=["seed=1"])
    assert not read_launch(folder / "RUN").is_own


def test_without_a_place_for_its_key_no_run_is_ones_own(folder, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(folder / "evil.py"))
    launch = read_launch(folder / "RUN")
    assert not launch.is_own
    dataclasses.replace(launch, seal="").write(folder / "RUN")
    assert not read_launch(folder / "RUN").is_own
    assert json.loads((folder / "RUN" / LAUNCH).read_text())["seal"] == ""


def test_trust_ends_with_its_command(tmp_path):
    with trust.trusting(tmp_path / "outputs"):
        assert trust.is_trusted(tmp_path / "outputs" / "run")
        assert not trust.is_trusted(tmp_path)
    assert not trust.is_trusted(tmp_path / "outputs" / "run")
