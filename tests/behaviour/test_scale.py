"""The key `scale`: on the command line, in the parameters, in records and tables, and in a sweep's pictures."""

import math
import shutil

import pytest
from omegaconf import OmegaConf

from lme.config.composer import parameters
from lme.errors import InputError
from runners.cli.main import main
from runners.config import schema
from runners.config.composer import Composer
from runners.config.job import scale_from_words, scale_in_words
from runners.records.records import find_runs, read_episodes
from runners.reports.analysis.summary import summarise
from runners.reports.figures.driven_runs import read_runs
from tests.builders import PUBLISHED

WORDS = ["map.worlds=[0,6]", "map.time_limit=2", "runs=1", "executor=serial", "tracking=none"]
COMBINED = "no_c_o+no_a_dev"


def test_factors_multiply_and_the_rest_stays():
    found = parameters("published", {}, (), {"c_t": 0.5, "d2": 3})
    assert found == {**PUBLISHED, "c_t": 102.92, "d2": 600.0}


def test_an_ablation_has_the_last_word():
    found = parameters("published", {"d1": math.inf, "c_o": 0.0}, (), {"d1": 0, "c_o": 2, "c_h": 2})
    assert found == {**PUBLISHED, "d1": math.inf, "c_o": 0.0, "c_h": 269.8}


@pytest.mark.parametrize(
    "scale",
    [
        {"a_mont": 2.0},
        {"a_mount": -1.0},
        {"d1": math.inf},
        {"d2": math.nan},
    ],
    ids=str,
)
def test_a_wrong_factor_is_named(scale, says):
    with says.raises(InputError):
        parameters("published", {}, (), scale)


def test_factors_as_text_are_read_back():
    assert scale_in_words({"a_close": 0.5, "d1": 2}) == "a_close × 0.5, d1 × 2"
    assert scale_in_words({"a_close": 1.0, "d1": 2}) == "d1 × 2"
    for scale in ({}, {"c_o": 0.0}, {"a_close": 1 / 3, "d2": 1e-7}):
        assert scale_from_words(scale_in_words(scale)) == pytest.approx(scale)


def test_the_guide_has_the_product_and_other_commands_do_without():
    schema.register()
    with Composer("eval") as composer:
        config = composer.compose(["++scale={d2:2}"])
        assert config.guide.parameters["d2"] == 400.0
        assert OmegaConf.to_container(composer.compose([]).scale) == {}
    with Composer("figure") as composer:
        assert composer.compose(["++scale={d2:2}"]).guide.parameters["d2"] == 400.0
    with Composer("replay") as composer:
        assert composer.compose([]).guide.parameters["d2"] == 200.0


@pytest.mark.parametrize(
    "words",
    [
        ["eval", "scale={a_clse:0.5}"],
        ["eval", "scale.a_clse=0.5"],
        ["eval", "-m", "scale={},{d3:0.5}"],
        ["eval", "scale.d1=abc"],
        ["eval", "scale={},{d1:2}"],
        ["train", "scale={d1:2}"],
        ["replay", "scale.d1=2"],
        ["figure", "scale={d3:2}"],
        ["figure", "guide=target", "scale={d1:2}"],
        ["eval", "-m", "system=lme,dwa", "scale={},{d1:2}"],
        ["eval", "held_out.mine=2"],
    ],
    ids=" ".join,
)
def test_a_wrong_scale_on_the_command_line_is_one_line(words, tmp_path, monkeypatch, capsys, says):
    monkeypatch.chdir(tmp_path)
    assert main(words) == 2
    says(capsys.readouterr().err)
    assert list(tmp_path.iterdir()) == []


@pytest.fixture(scope="module")
def sweep(tmp_path_factory):
    """Two ablations at once, with parameters as they are and with one halved."""
    folder = tmp_path_factory.mktemp("sweep")
    words = ["-m", "sim=fast", "scale.a_close=1,0.5", "ablation=[no_c_o, no_a_dev]", "hydra.sweep.dir=out"]
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert main(["eval", *words, *WORDS]) == 0
    return folder / "out"


def test_a_swept_scale_is_one_column(sweep):
    rows = summarise(read_episodes(find_runs([sweep])), systems={})
    assert [row.keys for row in rows] == [
        {"ablation": COMBINED, "scale": ""},
        {"ablation": COMBINED, "scale": "a_close × 0.5"},
    ]


def test_one_run_with_factors_is_not_taken_for_one_without(sweep):
    frame = read_episodes([sweep / "1"]).assign(ablation="none", subset="lab100")
    (row, *published) = summarise(frame)
    assert row.keys["scale"] == "a_close × 0.5"
    assert published == []


def test_figures_tell_scaled_jobs_apart(sweep):
    labels = [job.label for job in read_runs([sweep])]
    assert labels == ["LME without c_o and without a_dev", "LME without c_o and without a_dev, a_close × 0.5"]


def test_the_sweep_has_its_report_and_table_rewrites_it(sweep, tmp_path, capsys):
    names = [f"sensitivity.{end}" for end in ("md", "csv", "png", "pdf")]
    copy = tmp_path / "copy"
    shutil.copytree(sweep, copy)
    for name in names:
        (copy / name).unlink()
    capsys.readouterr()
    assert main(["table", str(copy)]) == 0
    assert "a_close (1.51):" in capsys.readouterr().out
    for name in names:
        assert (copy / name).read_bytes() == (sweep / name).read_bytes()
    text = (sweep / "sensitivity.md").read_text(encoding="utf-8")
    assert text.startswith(f"**LME, ablation {COMBINED} · barn")
    assert not (sweep / "ablation.md").exists()
