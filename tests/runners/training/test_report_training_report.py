"""The report at the end of a real training: its files, its links, and that a resumed run writes the same."""

import re

import pytest
import yaml

from runners.cli.main import main

SMALL = (
    "trials=5", "configurations=1", "runs=1", "search.startup=2", "tracking=none", "executor=serial",
    "race.candidates=[3,2]", "race.worlds=[1,2]", "hydra.run.dir=run",
)  # fmt: skip
FAMILIES = ("training.env1.configurations=2", "training.fresh.count=2", "training.indoor.count=2")


def train(*words):
    assert main(["train", *SMALL, *words]) == 0


def links(page):
    return [
        page.parent / link for link in re.findall(r'href="([^"]+)"', page.read_text()) if link != "data:,"
    ]


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """A training without the start among the candidates, so that a trial wins."""
    place = tmp_path_factory.mktemp("trained")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(place)
        train(*FAMILIES, "start_from_config=false")
    return place / "run"


def test_a_training_leaves_a_page_and_two_pictures(trained):
    assert all((trained / name).is_file() for name in ("report.html", "race.png", "parameters.png"))
    text = (trained / "report.html").read_text().replace("<wbr>", "")
    weights = yaml.safe_load((trained / "weights.yaml").read_text())
    assert f"<strong>{weights['held_out']['verdict'].title()}</strong>" in text
    assert f"trial {weights['trial']}" in text
    assert "lme compare run/start/env1 run/env1" in text


def test_every_link_leads_to_a_file_and_every_worst_world_has_a_page(trained):
    found = links(trained / "report.html")
    pages = [path for path in found if path.parent.name == "explain"]
    assert all(path.is_file() for path in found)
    assert len(pages) == 6  # there are six held-out worlds
    assert {path.parent.parent.name for path in pages} == {"env1", "fresh", "indoor"}
    assert all((path.parent / "index.html").is_file() for path in pages)


def test_the_figures_are_those_of_the_weight_file(trained):
    text = (trained / "report.html").read_text()
    held_out = yaml.safe_load((trained / "weights.yaml").read_text())["held_out"]["difference_to_start"]
    for place in ("env1", "fresh", "indoor"):
        line = re.search(rf'<th scope="row">{place}</th>.*?</tr>', text, re.S)[0]
        shown = [
            float(cell.replace("−", "-")) for cell in re.findall(r"<td>(?:<b>)?([−.\d]+)(?:</b>)?</td>", line)
        ]
        each = held_out[place]
        success, reward = each["success_difference"][0], each["reward_difference"][0]
        expected = [2, each["success"] - success, each["success"], each["reward"] - reward, each["reward"]]
        assert shown == pytest.approx(expected, abs=6e-4)


def test_a_resumed_run_writes_the_same_and_keeps_its_pages(trained, monkeypatch, capsys):
    monkeypatch.chdir(trained.parent)
    files = [trained / name for name in ("report.html", "race.png", "parameters.png")]
    before = [path.read_bytes() for path in files]
    pages = {path: path.stat().st_mtime_ns for path in trained.glob("*/explain/[0-9]*.html")}
    assert pages
    assert main(["train", "resume=run"]) == 0
    assert [path.read_bytes() for path in files] == before
    assert {path: path.stat().st_mtime_ns for path in pages} == pages
    assert "Report: run/report.html" in capsys.readouterr().out


def test_a_planner_that_is_tuned_has_a_report(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    train("guide=target", "planner=dwa", "robot=jackal", "map=barn", "map.subset=fresh", "map.count=2")
    page = tmp_path / "run" / "report.html"
    assert "planner.<wbr>clearance" in page.read_text()
    assert all(path.is_file() for path in links(page))
