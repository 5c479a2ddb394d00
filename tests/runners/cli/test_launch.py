"""From a command line to a run directory: composing, sweeping, resuming, ending."""

import errno
import gc
import json
import re
import shlex
from dataclasses import replace
from pathlib import Path

import pytest
import yaml
from omegaconf import DictConfig

from lme.errors import InputError
from runners.cli.launch import Command, launch
from runners.config import command_line
from runners.config.quoting import quoted, resume_command
from runners.records import launch_record
from tests.places import ROOT


class Probe:
    """A command that notes what it was given, and leaves records as a real one does."""

    def __init__(self):
        self.jobs, self.runs, self.finished, self.failure = [], [], [], None

    def launch(self, *argv):
        return launch(Command("eval", self.run, lambda job: None, self.finish_sweep), argv)

    def run(self, job):
        config, run_dir = job.config, job.run_dir
        self.jobs.append(job)
        self.runs.append((config, run_dir))
        (run_dir / "parts").mkdir(exist_ok=True)
        (run_dir / "parts" / "episodes.jsonl").write_text("{}\n")
        if self.failure is not None:
            raise self.failure

    def finish_sweep(self, job, run_dirs):
        self.finished.append((job.sweep_dir, run_dirs))

    @property
    def directory(self):
        return self.runs[-1][1]


@pytest.fixture
def probe(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return Probe()


def everything(folder="."):
    return sorted(str(path) for path in Path(folder).rglob("*"))


def test_a_run_has_its_own_named_directory(probe):
    assert probe.launch("seed=3") == 0
    (config, run_dir) = probe.runs[0]
    assert config.seed == 3
    assert run_dir.parent == Path("outputs/eval")
    record = launch_record.read_launch(run_dir)
    assert run_dir.name.endswith(f"-{record.fingerprint[:8]}")
    assert record.configs[0]["seed"] == 3
    assert (run_dir / ".hydra" / "config.yaml").is_file()
    assert not list(Path().rglob("*.log"))


def test_runs_of_the_same_second_do_not_share_a_directory(probe):
    for _ in range(3):
        probe.launch("seed=3")
    assert len({run_dir for _, run_dir in probe.runs}) == 3


def test_nothing_is_printed_by_hydra(probe, capfd):
    probe.launch()
    shown = capfd.readouterr()
    assert shown.out + shown.err == ""


@pytest.mark.parametrize("plus", ["", "+", "++"])
def test_a_plus_never_matters(probe, plus):
    assert probe.launch(f"{plus}robot=go2", f"{plus}runs=2", f"{plus}robot.lidar.num_beams=99") == 0
    config, _ = probe.runs[0]
    assert (config.robot.name, config.runs, config.robot.lidar.num_beams) == ("go2", 2, 99)


@pytest.mark.parametrize("at", [0, 2])
def test_multirun_may_stand_anywhere(probe, at):
    words = ["seed=0,1", "runs=1"]
    words.insert(at, "-m")
    assert probe.launch(*words) == 0
    assert [config.seed for config, _ in probe.runs] == [0, 1]


def test_a_sweep_runs_every_combination_and_finishes_once(probe, capsys):
    assert probe.launch("-m", "ablation=none,no_c_o,[no_c_o,no_c_t]", "seed=0,1") == 0
    seen = [(dict(config.ablation), config.seed) for config, _ in probe.runs]
    ablations = [{}, {"c_o": 0.0}, {"c_o": 0.0, "c_t": 0.0}]
    assert seen == [(ablation, seed) for ablation in ablations for seed in (0, 1)]
    ((sweep_dir, run_dirs),) = probe.finished
    assert (
        run_dirs == [run_dir for _, run_dir in probe.runs] == [sweep_dir / str(number) for number in range(6)]
    )
    assert "-sweep-" in sweep_dir.name
    assert "[6/6] ablation=[no_c_o,no_c_t] seed=1" in capsys.readouterr().err


def test_the_configs_of_jobs_that_have_run_are_not_kept(probe):
    """Those of a thousand jobs would take half a gigabyte."""
    composed = []

    def run(job):
        gc.collect()
        roots = [
            each for each in gc.get_objects() if isinstance(each, DictConfig) and each._get_parent() is None
        ]
        composed.append(len(roots))

    numbers = range(3)
    assert launch(Command("eval", run, lambda job: None), ["-m", f"seed={','.join(map(str, numbers))}"]) == 0
    assert composed == sorted(composed, reverse=True)
    assert composed[0] - composed[-1] == len(numbers) - 1  # one less after each job


def test_multirun_without_a_sweep_is_one_job(probe):
    assert probe.launch("-m", "seed=4") == 0
    assert len(probe.runs) == 1


def test_ablations_combine_and_take_new_keys(probe):
    assert probe.launch("ablation=[no_c_o,no_c_t]", "ablation.a_dev=0.5", "ablation.c_t=3") == 0
    assert dict(probe.runs[0][0].ablation) == {"c_o": 0.0, "c_t": 3.0, "a_dev": 0.5}


PUBLISHED = (ROOT / "conf" / "weight_set" / "published.yaml").read_text()


def test_weights_may_be_a_path_with_anything_in_it(probe, tmp_path):
    path = tmp_path / "my best, of [3].yaml"
    path.write_text(PUBLISHED.replace("a_close: 1.51", "a_close: 2.5"))
    assert probe.launch(f"weights='{path}'") == 0
    assert probe.runs[0][0].guide["parameters"]["a_close"] == 2.5


def test_the_weights_contents_are_part_of_the_fingerprint(probe, tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text(PUBLISHED.replace("a_close: 1.51", "a_close: 2.5"))
    probe.launch(f"weights={path}", "hydra.run.dir=out")
    path.write_text(PUBLISHED.replace("a_close: 1.51", "a_close: 2.6"))
    with pytest.raises(InputError, match=r"guide\.parameters\.a_close: 2\.5 there, 2\.6 now"):
        probe.launch(f"weights={path}", "hydra.run.dir=out", "resume=true")


def test_resume_by_path_alone_after_a_change_of_the_options_does_not_advise_itself(probe, tmp_path, says):
    path = tmp_path / "mine.yaml"
    path.write_text(PUBLISHED)
    probe.launch(f"weights={path}", "-m", "ablation.c_t=3,4", "hydra.sweep.dir=out")
    path.write_text(PUBLISHED.replace("a_close: 1.51", "a_close: 2.6"))
    for place in ("out", "out/1"):
        with says.raises(InputError):
            probe.launch(f"resume={place}")


def test_a_sweep_drives_the_options_as_they_were_when_it_began(probe, tmp_path, monkeypatch):
    """Somebody edits the robot's file while the first job runs."""
    file = tmp_path / "own" / "robot" / "mine.yaml"
    file.parent.mkdir(parents=True)
    text = (ROOT / "conf/robot/jackal.yaml").read_text().replace("name: jackal", "name: mine")
    file.write_text(text)
    run = probe.run

    def edit_and_run(job):
        file.write_text(text.replace("num_beams: 720", "num_beams: 811"))
        run(job)

    monkeypatch.setattr(probe, "run", edit_and_run)
    assert probe.launch("-m", "robot=mine", "seed=0,1", "--config-dir", "own") == 0
    assert [config.robot.lidar.num_beams for config, _ in probe.runs] == [720, 720]
    assert [dict(job.changes) for job in probe.jobs] == [{}, {}]
    recorded = [launch_record.read_launch(run_dir) for _, run_dir in probe.runs]
    assert [record.configs[0]["robot"]["lidar"]["num_beams"] for record in recorded] == [720, 720]
    assert [record.changes for record in recorded] == [[{}], [{}]]


def test_a_system_is_its_pair(probe):
    probe.launch("system=lme")
    config, with_system = probe.runs[0]
    assert config.system.label == "LME"
    probe.launch("guide=lme", "planner=simple")
    assert (
        launch_record.read_launch(with_system).fingerprint
        == launch_record.read_launch(probe.directory).fingerprint
    )


@pytest.mark.parametrize("word", ["experiment=quick", "+experiment=quick"])
def test_an_own_config_folder_adds_options_and_experiments(probe, tmp_path, word):
    own = tmp_path / "own" / "experiment"
    own.mkdir(parents=True)
    (own / "quick.yaml").write_text(
        "# @package _global_\ndefaults:\n  - override /robot: mine\nruns: 1\nseed: 9\n"
    )
    robot = (ROOT / "conf" / "robot" / "jackal.yaml").read_text().replace("name: jackal", "name: mine")
    (tmp_path / "own" / "robot").mkdir()
    (tmp_path / "own" / "robot" / "mine.yaml").write_text(robot)
    assert probe.launch(word, "--config-dir", "own", "seed=8") == 0
    config, _ = probe.runs[0]
    assert (config.robot.name, config.runs, config.seed) == ("mine", 1, 8)


@pytest.mark.parametrize("in_file", [False, True])
def test_a_glob_runs_options_of_the_user_too_but_no_file_that_others_inherit(probe, in_file):
    (Path("own") / "robot").mkdir(parents=True)
    for name in ("_tiny", "tiny"):
        Path("own", "robot", f"{name}.yaml").write_text(
            "# Tiny\ndefaults:\n  - jackal\n  - _self_\n\nname: tiny\n"
        )
    words = ["robot=glob([*t*,_*])"]
    if in_file:
        (Path("own") / "experiment").mkdir()
        params = "hydra:\n  mode: MULTIRUN\n  sweeper:\n    params:\n      robot: glob([*t*,_*])\n"
        Path("own", "experiment", "globs.yaml").write_text(f"# @package _global_\n# Globs\n{params}")
        words = ["experiment=globs"]
    assert probe.launch("--config-dir", "own", "-m", *words) == 0
    assert [config.robot.name for config, _ in probe.runs] == ["stage", "tiny", "turtlebot2"]


SEEDS = "# @package _global_\nhydra:\n  mode: MULTIRUN\n  sweeper:\n    params:\n      seed: 5,6\n"


def test_an_experiment_may_sweep(probe, tmp_path):
    own = tmp_path / "experiment"
    own.mkdir()
    (own / "seeds.yaml").write_text(SEEDS)
    assert probe.launch("experiment=seeds", "-cd", str(tmp_path)) == 0
    assert [config.seed for config, _ in probe.runs] == [5, 6]


# Directories


def test_a_given_directory_is_honoured(probe):
    assert probe.launch("hydra.run.dir=here/it is-${seed}", "seed=2") == 0
    assert probe.directory == Path("here/it is-2")


def test_with_multirun_a_given_run_directory_holds_the_sweep(probe):
    assert probe.launch("-m", "seed=0,1", "hydra.run.dir=here") == 0
    assert probe.finished == [(Path("here"), [Path("here/0"), Path("here/1")])]


@pytest.mark.parametrize("words", [("hydra.run.dir=here",), ("-m", "seed=0,1", "hydra.sweep.dir=here")])
def test_a_directory_that_holds_a_run_is_not_overwritten(probe, words, says):
    probe.launch(*words)
    before = {path: Path(path).stat().st_mtime_ns for path in everything()}
    with says.raises(InputError):
        probe.launch(*words)
    assert {path: Path(path).stat().st_mtime_ns for path in everything()} == before


@pytest.mark.parametrize("place", ["a_file", "a_file/below", "/proc/nowhere"])
def test_a_directory_that_cannot_be_made(probe, place, says):
    Path("a_file").write_text("")
    with says.raises(InputError):
        probe.launch(f"hydra.run.dir={place}")
    assert everything() == ["a_file"]
    assert not probe.runs


@pytest.mark.parametrize("key", ["run", "sweep"])
def test_a_directory_with_an_interpolation_of_nothing(probe, key):
    with pytest.raises(InputError, match=rf"hydra\.{key}\.dir: .*'x' not found"):
        probe.launch(*(["-m"] if key == "sweep" else []), f"hydra.{key}.dir=o/q${{x}}")
    assert everything() == []


@pytest.mark.parametrize("word", ["hydra.run.dir=locked/x", "resume=locked/x"])
def test_a_directory_that_cannot_be_read(probe, monkeypatch, word, says):
    for name in ("glob", "is_dir", "stat"):  # root, who may run the tests, can read everything
        monkeypatch.setattr(Path, name, denied_below("locked", getattr(Path, name)))
    with says.raises(InputError):
        probe.launch(word)
    assert not probe.runs


def denied_below(folder, method):
    def denied(path, *args, **kwargs):
        if folder in path.parts:
            raise PermissionError(errno.EACCES, "Permission denied", str(path))
        return method(path, *args, **kwargs)

    return denied


# Resuming


def test_resume_finds_the_newest_run_with_this_config(probe, monkeypatch):
    for seed in (1, 2, 1):
        probe.launch(f"seed={seed}")
    newest = probe.directory
    assert probe.launch("seed=1", "resume=true", "executor=serial", "tracking=none") == 0
    assert probe.directory == newest


def test_resume_without_such_a_run_says_what_was_looked_for(probe):
    probe.launch("seed=1")
    with pytest.raises(InputError, match=r"resume=true: no run with this config, outputs/eval/\*-\w{8}\*"):
        probe.launch("seed=2", "resume=true")


def test_resume_by_path_replays_the_overrides(probe):
    probe.launch("seed=5", "+robot=go2", "ablation=no_c_o", "ablation.a_dev=0.5")
    first, run_dir = probe.runs[0]
    record = (run_dir / "launch.json").read_text()
    assert probe.launch(f"resume={run_dir}") == 0
    again, directory = probe.runs[1]
    assert directory == run_dir
    assert again.resume == str(run_dir)
    assert replace(again, resume=False) == first
    assert (run_dir / "launch.json").read_text() == record


def test_a_resumed_run_takes_another_option_without_the_keys_of_the_former(probe):
    assert probe.launch("executor=process", "executor.workers=2") == 0
    assert probe.launch(f"resume={probe.directory}", "executor=serial") == 0
    assert "workers" not in probe.runs[-1][0].executor


def test_a_resumed_run_keeps_when_it_was_started_and_by_which_code(probe, monkeypatch):
    assert probe.launch("-m", "seed=0,1") == 0
    before = launch_record.read_launch(probe.directory)
    assert before.code.startswith("lme ")
    monkeypatch.setattr(launch_record, "code", lambda: "lme 9")
    assert probe.launch(f"resume={probe.directory.parent}") == 0
    assert launch_record.read_launch(probe.directory) == before
    assert probe.launch("seed=1") == 0
    assert launch_record.read_launch(probe.directory).code == "lme 9"


def test_resume_by_path_refuses_another_config_and_names_it(probe, says):
    probe.launch("seed=5")
    with says.raises(InputError):
        probe.launch(f"resume={probe.directory}", "seed=6", "runs=4")


@pytest.mark.parametrize("place", ["nowhere", "."])
def test_resuming_a_folder_without_a_run_is_refused(probe, place):
    with pytest.raises(InputError, match=f"resume={place}: "):
        probe.launch(f"resume={place}")


def test_resume_by_path_with_another_command(probe):
    probe.launch("hydra.run.dir=here")
    said = "resume=here: holds a run of lme eval, not of lme train: use lme eval resume=here"
    with pytest.raises(InputError, match=re.escape(said)):
        launch(Command("train", probe.run, lambda job: None), ["resume=here"])


@pytest.mark.parametrize(
    "name", ["a=b", "my runs", "it's [1], {2}", "3", "back\\slash", "outputs/eval/2026-01"]
)
def test_the_printed_command_resumes_as_typed(probe, name):
    probe.launch(f"hydra.run.dir={quoted(name)}")
    words = shlex.split(resume_command("eval", Path(name)))
    assert words[:2] == ["lme", "eval"]
    assert probe.launch(*words[2:]) == 0
    assert [run_dir for _, run_dir in probe.runs] == [Path(name)] * 2


def test_a_plain_path_is_printed_without_quotes():
    path = "/tmp/x/outputs/eval/2026-11-22_01-54-48-sweep-1a2b3c4d-2/0"
    assert resume_command("eval", Path(path)) == f"lme eval resume={path}"


def test_resume_by_path_and_another_directory_contradict(probe):
    probe.launch()
    with pytest.raises(InputError, match=r"omit hydra\.run\.dir"):
        probe.launch(f"resume={probe.directory}", "hydra.run.dir=other")


def test_resume_in_a_given_directory_checks_the_config(probe):
    probe.launch("hydra.run.dir=here", "seed=1")
    assert probe.launch("hydra.run.dir=here", "seed=1", "resume=true") == 0
    with pytest.raises(InputError, match="seed: 1 there, 2 now"):
        probe.launch("hydra.run.dir=here", "seed=2", "resume=true")


def test_resume_in_an_empty_given_directory_starts_afresh(probe, capsys, says):
    """Killed before the first record: the same command with resume=true starts from nothing."""
    assert probe.launch("hydra.run.dir=here", "resume=true") == 0
    says(capsys.readouterr().err)


@pytest.mark.parametrize("by_path", [False, True])
def test_a_sweep_resumes(probe, by_path):
    probe.launch("-m", "seed=0,1")
    sweep_dir, run_dirs = probe.finished[0]
    words = [f"resume={sweep_dir}"] if by_path else ["-m", "seed=0,1", "resume=true"]
    assert probe.launch(*words) == 0
    assert probe.finished == [(sweep_dir, run_dirs)] * 2


def test_one_job_of_a_sweep_resumes_and_still_belongs_to_it(probe):
    probe.launch("-m", "seed=0,1")
    sweep_dir, run_dirs = probe.finished[0]
    assert probe.launch(f"resume={run_dirs[1]}") == 0
    assert (probe.runs[-1][0].seed, probe.directory) == (1, run_dirs[1])
    probe.launch(f"resume={sweep_dir}")
    assert probe.finished[-1] == (sweep_dir, run_dirs)


def test_one_job_of_an_experiments_sweep_resumes(probe, tmp_path):
    (tmp_path / "experiment").mkdir()
    (tmp_path / "experiment" / "seeds.yaml").write_text(SEEDS)
    probe.launch("experiment=seeds", "-cd", str(tmp_path))
    sweep_dir, run_dirs = probe.finished[0]
    assert probe.launch(f"resume={run_dirs[1]}") == 0
    assert (probe.runs[-1][0].seed, probe.directory, len(probe.runs)) == (6, run_dirs[1], 3)
    assert probe.launch(f"resume={sweep_dir}") == 0
    assert probe.finished[1:] == [(sweep_dir, run_dirs)]


def test_a_sweep_of_other_jobs_is_not_the_same(probe):
    probe.launch("-m", "seed=0,1", "hydra.sweep.dir=here")
    for seeds in ("1,0", "0,1,2"):
        with pytest.raises(InputError, match="here: holds"):
            probe.launch("-m", f"seed={seeds}", "hydra.sweep.dir=here", "resume=true")


def test_a_folder_left_by_a_larger_sweep_is_not_a_job(probe):
    probe.launch("-m", "seed=0,1,2", "hydra.sweep.dir=here")
    for path in [Path("here/launch.json"), *Path("here").rglob("episodes.jsonl")]:
        path.unlink()
    assert probe.launch("-m", "seed=3,4", "hydra.sweep.dir=here") == 0
    assert Path("here/2/launch.json").is_file()
    assert probe.finished[-1] == (Path("here"), [Path("here/0"), Path("here/1")])


# Looking before running


def test_the_composed_config_is_shown_and_nothing_written(probe, capsys):
    assert probe.launch("seed=7", "--cfg", "job", "robot=go2") == 0
    shown = capsys.readouterr().out
    assert "seed: 7" in shown
    assert "name: go2" in shown
    assert probe.launch("-m", "seed=7,8", "--cfg", "job", "--package", "seed") == 0
    assert probe.launch("--info", "defaults") == 0
    assert probe.launch("--hydra-help") == 0
    assert everything() == []


def test_the_config_is_shown_with_every_value_resolved(probe, capsys, says):
    assert probe.launch("--cfg", "job", "--resolve", "ablation=no_c_o") == 0
    shown = yaml.safe_load(capsys.readouterr().out)
    assert shown["guide"]["parameters"]["c_o"] == 0.0
    assert shown["robot"]["name"] == "jackal"
    with says.raises(InputError):
        probe.launch("--cfg", "job", "--package", "nothing")
    assert everything() == []


@pytest.mark.parametrize("what", ["hydra", "all"])
def test_hydras_own_part_is_shown_resolved(probe, capsys, what):
    assert probe.launch("--cfg", what, "--resolve", "seed=3", "hydra.run.dir=out/${seed}") == 0
    shown = yaml.safe_load(capsys.readouterr().out)["hydra"]
    assert shown["run"]["dir"] == "out/3"
    assert shown["sweep"]["subdir"] == shown["job"]["num"] == "???"


def test_an_interpolation_of_nothing_is_not_shown(probe, says):
    with says.raises(InputError):
        probe.launch("--cfg", "hydra", "--package", "hydra.sweep.subdir")
    with pytest.raises(InputError, match=r"hydra\.run\.dir: .*'x' not found"):
        probe.launch("--cfg", "hydra", "--resolve", "hydra.run.dir=o/${x}")


def test_a_home_directory_is_known_behind_the_equals_sign(probe, monkeypatch, tmp_path):
    monkeypatch.setenv("HOME", str(tmp_path / "me"))
    room = tmp_path / "me" / "room.yaml"
    room.parent.mkdir()
    room.write_text("bounds: [0, 0, 5, 5]\n")
    assert probe.launch("map=file", "map.path=~/room.yaml", "map.min_distance=1", "hydra.run.dir=~/out") == 0
    assert probe.runs[0][0].map["path"] == str(room)
    assert (tmp_path / "me" / "out" / "launch.json").is_file()


def test_tracking_heeds_mlflows_own_variable(probe, monkeypatch):
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    probe.launch()
    monkeypatch.setenv("MLFLOW_TRACKING_URI", "http://tracker:5000")
    probe.launch()
    uris = [config.tracking["uri"] for config, _ in probe.runs]
    assert uris == ["sqlite:///outputs/mlflow.db", "http://tracker:5000"]


def test_every_job_of_a_sweep_is_validated_before_anything_is_written(probe):
    def validate(job):
        if job.config.seed == 2:
            raise InputError("seed is 2: must be another")

    with pytest.raises(InputError, match="seed is 2"):
        launch(Command("eval", probe.run, validate), ["-m", "seed=0,1,2"])
    assert everything() == []


def test_of_a_very_large_sweep_every_value_is_checked(probe, monkeypatch):
    monkeypatch.setattr(command_line, "MAX_JOBS_CHECKED", 4)
    seen = set()
    with pytest.raises(InputError, match="seed is x"):
        probe.launch("-m", "seed=0,1,x", "runs=1,2")
    probe.finish_sweep = None
    command = Command("eval", probe.run, lambda job: seen.add((job.config.seed, job.config.runs)))
    assert launch(command, ["-m", "seed=0,1,2", "runs=1,2"]) == 0
    assert {seed for seed, _ in seen} == {0, 1, 2}
    assert {runs for _, runs in seen} == {1, 2}
    assert len(probe.runs) == 6


# Ends


def test_an_input_error_in_the_run_is_one_line(probe, capsys, says):
    probe.failure = InputError("map.source is x: must be a folder")
    assert probe.launch() == 2
    says(capsys.readouterr().err)


def test_a_full_disk_is_one_line(probe, capsys, says):
    probe.failure = OSError(errno.ENOSPC, "No space left on device", "run/table.md")
    assert probe.launch() == 1
    says(capsys.readouterr().err)


@pytest.mark.parametrize("number", [errno.EROFS, errno.EACCES])
def test_a_place_that_cannot_be_written_is_one_line(probe, capsys, number, says):
    probe.failure = OSError(number, "Not allowed", "run/table.md")
    assert probe.launch() == 1
    says(capsys.readouterr().err)


def test_a_bug_keeps_its_traceback(probe, monkeypatch):
    monkeypatch.setattr("runners.cli.launch._relative", len)
    with pytest.raises(TypeError, match="has no len"):
        probe.launch()


@pytest.mark.parametrize("error", [ZeroDivisionError("oops"), SystemExit("oops")])
def test_an_error_of_a_users_own_code_is_one_line_and_ends_its_job_alone(probe, capsys, error):
    probe.failure = error
    assert probe.launch("-m", "seed=0,1") == 1
    said = rf"lme eval: \S+\.py:\d+: {type(error).__name__}: oops \(LME_TRACEBACK=1 shows the traceback\)$"
    assert len(re.findall(said, capsys.readouterr().err, re.MULTILINE)) == 2


def test_an_interrupt_is_130_and_says_how_to_continue(probe, capsys):
    probe.failure = KeyboardInterrupt()
    assert probe.launch("-m", "seed=0,1") == 130
    assert f"resume={probe.directory.parent}" in capsys.readouterr().err
    assert len(probe.runs) == 1
    assert not probe.finished


def test_the_launch_record_is_plain_json(probe):
    probe.launch("ablation=no_maintenance")
    text = (probe.directory / "launch.json").read_text()
    assert json.loads(text)["configs"][0]["ablation"] == {"d1": "inf"}
    assert "Infinity" not in text


def test_ranges_of_worlds_may_be_swept(probe):
    probe.launch("-m", "map.worlds=0-2,7,[3-4,9]")
    assert [config.map["worlds"] for config, _ in probe.runs] == [[0, 1, 2], [7], [3, 4, 9]]
    saved = yaml.safe_load((probe.directory / ".hydra" / "config.yaml").read_text())
    assert saved["map"]["worlds"] == [3, 4, 9]


def test_ranges_of_worlds_in_a_sweep_too_large_to_compose_beforehand(probe, monkeypatch):
    monkeypatch.setattr(command_line, "MAX_JOBS_CHECKED", 4)
    probe.launch("-m", "map.worlds=0-1,2-3", "seed=range(3)")
    assert [config.map["worlds"] for config, _ in probe.runs] == [[0, 1]] * 3 + [[2, 3]] * 3


def test_a_run_of_listed_worlds_is_resumed_by_their_range(probe):
    probe.launch("map.worlds=[0,1,2]")
    probe.launch("map.worlds=0-2", "resume=true")
    assert probe.runs[0][1] == probe.runs[1][1]


@pytest.mark.parametrize(
    "words",
    [
        ["runs=1", "runs=2"],
        ["map=barn", "+map=env1"],
        ["-m", "seed=0,1", "seed=3"],
        ["hydra.run.dir=a", "hydra.run.dir=b"],
        ["map.subset=official50", "map.worlds=[1,2]"],
        ["map.subset=hard100", "map.worlds=190-220"],
        ["-m", "map.subset=all,official50", "map.worlds=1"],
        ["map.count=3"],
        ["-m", "map.subset=all,hard100", "map.fresh_seed=0"],
    ],
    ids=" ".join,
)
def test_contradicting_arguments_are_refused(probe, words, says):
    with says.raises(InputError):
        probe.launch(*words)
    assert everything() == []


@pytest.mark.parametrize(
    "words",
    [
        ["runs=1", "runs=1"],
        # Over the file's own.
        ["experiment=ablation_fresh", "hydra.mode=RUN", "runs=4", "map.worlds=1000-1003"],
        ["experiment=lme_plus_ablation", "hydra.mode=RUN", "map.subset=official50"],
        ["map.subset=official50", "map.worlds=[0,6]"],
        ["map.subset=all", "map.worlds=[1,2]"],
        ["map.subset=fresh", "map.worlds=[1005]"],
        ["map.subset=fresh", "map.count=3", "map.fresh_seed=5"],
        ["-m", "map.subset=lab100,fresh_hard", "map.count=3"],
        ["-m", "map.subset=lab100,hard100"],
        ["map=social", "map.count=3"],
        ["experiment=sensitivity", "hydra.mode=RUN", "map.count=3"],
        ["map=env1", "map.worlds=[1,2]"],
    ],
)
def test_words_that_do_not(probe, words):
    assert probe.launch(*words) == 0


def test_a_resumed_run_may_have_other_words_and_contradictory_ones(probe):
    probe.launch("seed=3", "runs=1", "map.worlds=[1,2]")
    saved = json.loads((probe.directory / "launch.json").read_text())
    saved["overrides"] = ["runs=2", *saved["overrides"], "map.subset=lab100", "map.subset=lab100"]
    (probe.directory / "launch.json").write_text(json.dumps(saved))
    assert probe.launch(f"resume={probe.directory}", "executor=serial") == 0
