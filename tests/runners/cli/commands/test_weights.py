"""`lme weights`: list learned weights, and import a network."""

import pytest

from lme.errors import InputError
from lme.guides.lme.weight_files import REGISTERED, find_network
from lme.inputs.onnx_graph import read_weights
from lme.planners.dclp.weights import SHAPES, SIGNATURE
from lme.planners.ipaprec import tensor_names
from runners.cli.commands import weights
from runners.config.build import navigator
from tests.composing import jobs_of
from tests.networks import checkpoint, random_drl_vo, random_ipaprec, random_weights
from tests.torch_archives import archive


@pytest.fixture(autouse=True)
def source(tmp_path, monkeypatch):
    """A checkpoint of a random network, in the folder that one is in."""
    monkeypatch.chdir(tmp_path)
    return checkpoint(tmp_path / "step-100", random_weights())


def test_an_imported_network_is_listed_and_drives(source, capsys):
    assert weights.main(["import", "dclp", str(source), "mine"]) == 0
    assert "planner.weights=mine" in capsys.readouterr().out
    found, wanted = read_weights(REGISTERED / "mine.onnx", SIGNATURE.what), random_weights()
    assert all((found[name] == wanted[name]).all() for name in SHAPES)
    assert weights.main([]) == 0
    out = capsys.readouterr().out
    assert "weights=published, ships with lme" in out
    assert "planner.weights=mine, outputs/weights/mine.onnx" in out
    assert "planner.weights=dclp_jackal, ships with lme" in out
    assert "guide.weights=learned_subgoal, ships with lme" in out
    with jobs_of("eval", "planner=dclp_barn", "planner.weights=mine") as job:
        for guide in ("target", "lme", "global_path"):
            navigator(job(f"guide={guide}").config)


def test_an_imported_network_of_drl_vo_drives_along_a_path(tmp_path, capsys):
    assert weights.main(["import", "drl_vo", str(archive(tmp_path / "drl_vo.zip", random_drl_vo()))]) == 0
    out = capsys.readouterr().out
    assert "lme eval guide=global_path planner=drl_vo_barn planner.weights=drl_vo" in out
    with jobs_of("eval", "planner=drl_vo_barn", "planner.weights=drl_vo") as job:
        navigator(job("guide=global_path").config)


@pytest.mark.parametrize(("network", "sectors"), [("maer_nav", 32), ("drl_nsuo", 30)])
def test_the_other_networks_of_the_laboratory_drive_as_systems(tmp_path, network, sectors):
    prefix = checkpoint(tmp_path / "model-36", random_ipaprec(sectors), names=tensor_names())
    assert weights.main(["import", network, str(prefix)]) == 0
    with jobs_of("eval", f"system={network}") as job:
        navigator(job().config)


def test_the_default_name_and_a_second_import(source):
    for _ in range(2):
        assert weights.main(["import", "dclp", str(source)]) == 0
    assert [path.name for path in REGISTERED.iterdir()] == ["dclp.onnx"]


@pytest.mark.parametrize("name", ["a/b", "..", ".hidden", ""])
def test_a_name_must_be_a_file_name(source, name):
    with pytest.raises(InputError, match=r"NAME is '"):
        weights.main(["import", "dclp", str(source), name or "/"])


def test_nothing_is_written_for_a_checkpoint_that_is_refused(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        weights.main(["import", "dclp", str(tmp_path / "none")])
    assert not REGISTERED.exists()


@pytest.mark.parametrize("weights", ["mine", "w.npz", "run"])
def test_a_network_of_an_earlier_version_is_named(tmp_path, weights):
    for path in (REGISTERED / "mine.npz", tmp_path / "w.npz", tmp_path / "run" / "weights.npz"):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"PK")
    with pytest.raises(
        InputError, match=rf"is '{weights}': .*npz is of an earlier lme; networks are ONNX files now"
    ):
        find_network(weights)


def test_a_network_that_does_not_exist(source, says):
    weights.main(["import", "dclp", str(source), "first"])
    with (
        jobs_of("eval", "planner=dclp") as job,
        says.raises(InputError, match="weights.*'frist'"),
    ):
        navigator(job("planner.weights=frist").config)
