"""A sweep over systems: one table, one chart, one tracked run above its jobs'."""

import json
import shutil
from pathlib import Path

import pandas as pd
import pytest
import yaml
from mlflow import MlflowClient

from lme.config.composer import SHIPPED
from runners.cli.main import main
from runners.config import systems
from runners.config.catalogue import shipped
from runners.records.records import find_runs, read_episodes, read_trajectories
from runners.reports.figures.driven_runs import runs_of
from runners.reports.figures.stage import places
from runners.tracking.store import RUN_ID_FILE
from tests.runners.tracking.test_mlflow import logged

WORDS = ["map.worlds=[0,6]", "map.subset=all", "runs=1", "executor=serial"]


@pytest.fixture(scope="module")
def sweep(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sweep")
    uri = f"sqlite:///{folder}/store.db"
    words = ["-m", "sim=fast", "guide=target,lme", "table=[lme,drl_vo]", f"hydra.sweep.dir={folder}/out"]
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert main(["eval", *words, *WORDS, f"tracking.uri={uri}"]) == 0
    return folder / "out", uri


def test_without_factors_or_ablations_there_are_no_reports_of_them(sweep):
    assert not [path for kind in ("sensitivity", "ablation") for path in sweep[0].glob(f"{kind}.*")]


def test_rows_in_the_order_of_the_config(sweep):
    lines = (sweep[0] / "table.csv").read_text().splitlines()
    assert [line.split(",")[0] for line in lines] == ["label", "LME", "Simple"]


def test_the_chart_is_there_and_table_redraws_it(sweep, capsys):
    chart = sweep[0] / "comparison.png"
    assert chart.read_bytes().startswith(b"\x89PNG")
    assert (sweep[0] / "comparison.pdf").read_bytes().startswith(b"%PDF")
    differences = sweep[0] / "comparison.csv"
    before, table = chart.read_bytes(), (sweep[0] / "table.md").read_text()
    paired = differences.read_text()
    chart.unlink()
    differences.unlink()
    assert main(["table", str(sweep[0])]) == 0
    assert chart.read_bytes() == before
    assert differences.read_text() == paired
    assert "Paired differences from LME, barn" in capsys.readouterr().out
    assert (sweep[0] / "table.md").read_text() == table


def test_a_sweep_without_the_steps_of_a_job_has_a_table_but_no_paths(sweep, tmp_path, says):
    copy = shutil.copytree(sweep[0], tmp_path / "copy")
    (copy / "1" / "trajectories.parquet").unlink()
    (copy / "side_by_side.png").unlink()
    with says.warns():
        assert main(["table", str(copy)]) == 0
    assert not (copy / "side_by_side.png").exists()


def test_the_paths_stand_side_by_side(sweep):
    assert (sweep[0] / "side_by_side.png").read_bytes().startswith(b"\x89PNG")
    assert (sweep[0] / "side_by_side.pdf").read_bytes().startswith(b"%PDF")
    frame = read_episodes([sweep[0] / "0", sweep[0] / "1"])
    jobs = runs_of(frame, [sweep[0] / number for number in "01"])
    assert [job.label for job in jobs] == ["Simple", "LME"]
    assert [place.name for place in places(jobs)] == ["barn, world 0", "barn, world 6"]


def test_starts_in_the_same_world_share_a_panel(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = ["-m", "map=traps", "robot=stage", "map.kind=u,wall", "map.starts=2"]
    quick = ["map.time_limit=1", "runs=1", "executor=serial", "tracking=none", "hydra.sweep.dir=out"]
    assert main(["eval", *words, *quick]) == 0
    runs = find_runs([Path("out")])
    frame = read_episodes(runs)
    found = places(runs_of(frame, runs))
    assert [(place.name, place.numbers) for place in found] == [
        ("traps: u", (0, 1)),
        ("traps: wall", (0, 1)),
    ]


def test_smoothness_is_that_of_the_executed_turn_rates(sweep):
    (episode,) = read_episodes([sweep[0] / "1"]).query("world == 0").to_dict("records")
    rates = read_trajectories([sweep[0] / "1"]).query("world == 0")["omega_radps"]
    assert episode["mean_abs_domega_radps"] == pytest.approx(rates.diff().abs().mean(), rel=1e-12)
    assert len(rates) == episode["steps"] + 1


def test_the_parent_run_of_a_sweep_holds_the_table_and_its_jobs_the_metrics(sweep):
    out, uri = sweep
    parent = logged(uri, out)
    assert parent.data.metrics == {}
    assert parent.info.run_name.startswith("sweep · ")
    assert "\n| LME | " in parent.data.tags["mlflow.note.content"]
    assert {key: parent.data.params.get(key) for key in ("system", "robot")} == {
        "system": None,
        "robot": "jackal",
    }
    assert parent.data.params["robot.name"] == "jackal"
    assert "guide._target_" not in parent.data.params  # the jobs differ in it
    files = {file.path for file in MlflowClient(uri).list_artifacts(parent.info.run_id)}
    assert {"table.md", "table.csv", "table.tex", "comparison.png", "side_by_side.png"} <= files
    for number in "01":
        run_id = json.loads((out / number / RUN_ID_FILE).read_text())["run"]
        run = MlflowClient(uri).get_run(run_id)
        assert run.data.tags["mlflow.parentRunId"] == parent.info.run_id
        assert run.data.params["system"] == ("simple", "lme")[int(number)]
        assert "success" in run.data.metrics


def test_a_row_that_is_not_a_system_is_refused(capsys, says):
    assert main(["eval", "table=[drl_v]"]) == 2
    says(capsys.readouterr().err)


@pytest.mark.slow
def test_a_launcher_of_processes_gives_the_same_records(tmp_path, monkeypatch):
    """Its workers may not start workers of their own: they drive their episodes one after the other."""
    monkeypatch.chdir(tmp_path)
    for name, words in (("joblib", ["hydra/launcher=joblib"]), ("basic", [])):
        sweep = [
            "map.worlds=[0,3]",
            "runs=1",
            "ablation=none,no_c_t",
            "tracking=none",
            f"hydra.sweep.dir={name}",
        ]
        assert main(["eval", "-m", *sweep, *words]) == 0
    for job in "01":
        frames = [pd.read_parquet(tmp_path / name / job / "episodes.parquet") for name in ("joblib", "basic")]
        timed = ["wall_s", "decision_us_p50", "decision_us_p99"]
        pd.testing.assert_frame_equal(*(frame.drop(columns=timed) for frame in frames))


def test_labels_are_unique_among_the_pairs_that_run():
    pairs = systems.systems()
    assert len({each.label for each in pairs.values()}) == len(pairs)
    files = [yaml.safe_load(shipped().file(f"system/{name}").read_text("utf-8")) for name in pairs]
    chosen = {repr({key: value for key, value in file.items() if key != "system"}) for file in files}
    assert len(chosen) == len(pairs)


@pytest.mark.parametrize(
    ("guide", "planner", "label"), [("lme", "simple", "LME"), ("lme_plus", "min_time", "LME+")]
)
def test_a_pair_has_the_label_of_the_whole_method(guide, planner, label):
    """Weights, an ablation and removed parts are named by choosing their system."""
    (system,) = systems.system_of(guide, planner, SHIPPED).values()
    assert system.label == label
