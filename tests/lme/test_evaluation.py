"""`lme.evaluate`: the records of `lme eval`, from a script, from standard input and from a notebook."""

import json
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import pandas as pd
import pytest
from hydra import initialize_config_dir
from hydra.core.global_hydra import GlobalHydra

import lme
import lme.evaluation
from runners.cli import main
from tests.places import ROOT

pytestmark = pytest.mark.usefixtures("undrawn")

MEASURED = ["decision_us_p50", "decision_us_p99", "wall_s"]  # times that no two runs have in common
WORLDS = "map.worlds=[200,201]"
CALL = f"""
import lme
frame = lme.evaluate("{WORLDS}", runs=1, workers=2)
print(frame["outcome"].tolist(), len(frame.columns))
"""


def driven(*words, **keys):
    return lme.evaluate(*words, **{"runs": 1, "executor": "serial", "progress": False, **keys})


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("into", [None, "kept"])
def test_the_frame_is_that_of_the_command(folder, into):
    words = [WORLDS, "sim=skid"]
    assert main.main(["eval", *words, "runs=2", "tracking=none", "hydra.run.dir=command"]) == 0
    there = pd.read_parquet("command/episodes.parquet")
    keys = {"sim": "skid", "runs": 2, "workers": 2}
    here = lme.evaluate(WORLDS, **keys, into=into, progress=False)
    pd.testing.assert_frame_equal(here.drop(columns=MEASURED), there.drop(columns=MEASURED), check_exact=True)
    assert list(here.columns) == list(there.columns)
    assert len(here) == 4


def test_nothing_is_written_or_said_unless_asked_for(folder, capfd):
    assert len(driven(WORLDS)) == 2
    assert list(folder.iterdir()) == []
    assert capfd.readouterr() == ("", "")


def test_a_bar_shows_on_standard_error(folder, capfd):
    driven(WORLDS, progress=True)
    shown = capfd.readouterr()
    assert "2/2" in shown.err
    assert shown.out == ""


def test_a_directory_has_what_the_command_writes(folder):
    assert main.main(["eval", WORLDS, "runs=1", "tracking=none", "hydra.run.dir=command"]) == 0
    driven(WORLDS, into="kept")
    names = {path.name for path in (folder / "command").iterdir()} - {".hydra"}
    assert {path.name for path in (folder / "kept").iterdir()} == names
    one, other = (json.loads((folder / name / "launch.json").read_text()) for name in ("command", "kept"))
    assert one["fingerprint"] == other["fingerprint"]


def test_a_run_is_resumed(folder, says):
    first = driven(WORLDS, into="kept", resume=True)  # nothing there yet
    with says.raises(lme.InputError):
        driven(WORLDS, into="kept")
    again = driven(WORLDS, into="kept", resume=True)
    pd.testing.assert_frame_equal(first, again)  # the measured times too: nothing was driven
    with says.raises(lme.InputError):
        driven(WORLDS, into="kept", resume=True, seed=1)


def test_two_threads_evaluate_at_once(folder):
    with ThreadPoolExecutor(2) as threads:
        one, other = threads.map(lambda _: driven(WORLDS), range(2))
    assert one["steps"].tolist() == other["steps"].tolist()


def test_a_program_that_uses_hydra_itself_may_evaluate(folder):
    with initialize_config_dir(str(ROOT / "conf"), "mine", version_base="1.3"):
        former = GlobalHydra.instance().hydra
        assert len(driven(WORLDS)) == 2
        assert GlobalHydra.instance().hydra is former


def test_values_of_python(folder):
    keys = {"map.worlds": range(200, 202), "ablation": ["no_c_o", "no_c_h"], "scale": {"a_mount": 0.5}}
    frame = driven(**keys, into="kept", weights=str(ROOT / "conf" / "weight_set" / "skid.yaml"))
    assert frame["world"].tolist() == [200, 201]
    assert set(frame["ablation"]) == {"no_c_o+no_c_h"}
    launch = json.loads((folder / "kept" / "launch.json").read_text())
    assert launch["configs"][0]["scale"] == {"a_mount": 0.5}


@pytest.mark.parametrize(
    ("words", "keys"),
    [
        (["sytem=lme"], {}),
        ([5], {}),
        ([], {"into": 5}),
        ([], {"config_dir": ["x"]}),
        (["system=lme,dwa"], {}),
        ([], {"map": ["barn", "env1"]}),
        ([], {"robot": "mine"}),
        ([], {"into": "/dev/null/x"}),
        ([], {"workers": 2}),
        ([], {"workers": 2.5, "executor": "process"}),
        ([], {"system": "dwa", "weights": "skid"}),
        (["experiment=traps"], {}),
        ([], {"seed": object()}),
        (["resume=true"], {}),
        (["hydra.run.dir=here"], {}),
        ([], {"resume": True}),
        ([], {"record": "mcap"}),
        ([], {"explain": "all"}),
        (["tracking=mlflow"], {}),
        ([], {"workers": 0, "executor": "process"}),
        ([], {"config_dir": "nowhere"}),
    ],
)
def test_mistakes(folder, words, keys, says):
    with says.raises(lme.InputError):
        driven(WORLDS, *words, **keys)
    assert list(folder.iterdir()) == []


def test_the_library_alone_says_what_to_install(monkeypatch, says):
    monkeypatch.setattr(lme.evaluation, "find_spec", lambda name: None if name in ("hydra", "pandas") else 1)
    with says.raises(ImportError):
        lme.evaluate()


@pytest.mark.parametrize("how", ["file", "standard input"])
def test_a_script_needs_no_guard(tmp_path, how):
    """Workers do not run the script once more."""
    (tmp_path / "script.py").write_text(CALL)
    words, given = (["script.py"], None) if how == "file" else (["-"], CALL)
    done = subprocess.run(
        [sys.executable, *words],
        input=given,
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("['success', 'success'] ")
    assert [path.name for path in tmp_path.iterdir()] == ["script.py"]


def test_a_notebook_shows_a_bar_in_one_output(tmp_path):
    nbclient = pytest.importorskip("nbclient")
    nbformat = pytest.importorskip("nbformat")
    pytest.importorskip("ipykernel")
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(CALL)])
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    client = nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}})
    client.execute(env=environment)
    outputs = notebook.cells[0].outputs
    (bar,) = [output for output in outputs if output.output_type == "display_data"]
    assert "2/2 2 success" in bar["data"]["text/plain"]
    (printed,) = [output["text"] for output in outputs if output.get("name") == "stdout"]
    assert printed.startswith("['success', 'success'] ")
    assert "ipywidgets" not in str(outputs)
