"""The report of a training: figures, marks and links, names as text, its looks in a browser, and of a resumed run."""

import html
import re
from base64 import b64decode
from dataclasses import replace

import pytest
import yaml

from runners.cli.main import main
from runners.config.space import Range
from runners.records.episode_record import EpisodeKey
from runners.reports.analysis.paired import Difference
from runners.training import pictures
from runners.training.held_out import HeldOutComparison
from runners.training.pictures import parameters_figure, race_figure
from runners.training.race import START, Race, Rung
from runners.training.report import TrainingReport, write_report
from runners.training.report_tables import WorstWorld
from tests.made_training import RACE, SPACE, TRIALS
from tests.runners.reports.explainer.conftest import browser, open_page  # noqa: F401 - fixtures

HOSTILE = '{{RACE}}"><script>alert("1")</script><img src=x onerror=alert(1)>'
BETTER = Difference(0.1, 0.05, 0.15, 0.01, 20, 60)
WORSE = Difference(-0.2, -0.3, -0.1, 0.01, 20, 60)
LEVEL = Difference(0.0, -0.1, 0.1, 1.0, 20, 60)
ALONE = Difference(0.1, float("nan"), float("nan"), float("nan"), 1, 1)
SMALL = (
    "trials=5", "configurations=1", "runs=1", "search.startup=2", "tracking=none", "executor=serial",
    "race.candidates=[3,2]", "race.worlds=[1,2]", "hydra.run.dir=run",
)  # fmt: skip
FAMILIES = ("training.env1.configurations=2", "training.fresh.count=2", "training.indoor.count=2")


def row(success_change=BETTER, reward_change=WORSE):
    return HeldOutComparison(0.9, 0.05, 0.4, success_change, LEVEL, reward_change)


def world(folder, number, outcome="collision", lost=1, start_failed=0):
    failed = 3 if outcome == "collision" else 0
    return WorstWorld(folder, EpisodeKey(number, 2), outcome, -0.2, 12.0, 3, failed, start_failed, lost)


def report_of(place, **changes):
    made = TrainingReport(
        title="Training of LME on stage",
        facts="5 trials",
        sentence="Better: the new weights earn more",
        sign=1,
        start="published",
        winner=3,
        best=3,
        training_reward=0.65,
        training_worlds="4 worlds",
        gap=0.25,
        held_out={"env1": row(), "fresh": row(), "all": row()},
        figures=new_figures(),
        race=RACE,
        trials=TRIALS,
        space=SPACE,
        start_values={"guide.parameters.c_o": 2000.0, "planner.kp": None},
        importances={"guide.parameters.c_o": 0.75, "planner.kp": 0.25},
        worst=[world(place / "env1", 7), world(place / "fresh", 8, "success", 0)],
        failures=3,
        regressions=2,
        commands={"Compare": "lme compare a b"},
        files=[place / "race.png"],
    )
    return replace(made, **changes)


def new_figures():
    return {
        "parameters": parameters_figure(TRIALS, SPACE, 3, {}, frozenset()),
        "race": race_figure(RACE, "published"),
    }


def written(place, **changes):
    path = place / "report.html"
    write_report(report_of(place, **changes), path)
    return path


def cells(path, kind):
    """The text of a table, row by row."""
    table = re.search(rf'<table class="{kind}">.*?</table>', path.read_text(encoding="utf-8"), re.S)[0]
    rows = re.findall(r"<tr[^>]*>(.*?)</tr>", table, re.S)
    plain = [
        [re.sub(r"<[^>]+>", " ", cell) for cell in re.findall(r"<t[hd].*?</t[hd]>", row)] for row in rows
    ]
    return [[" ".join(html.unescape(cell).split()) for cell in row] for row in plain]


def test_the_headline_is_the_verdict(tmp_path):
    text = written(tmp_path).read_text(encoding="utf-8")
    assert (
        '<p class="verdict better"><strong>Better</strong> <span>The new weights earn more.</span></p>'
        in text
    )
    assert "0.250 above that of the held-out maps" in text
    assert 'class="verdict worse"' in written(tmp_path, sign=-1).read_text(encoding="utf-8")


def test_held_out_maps_show_both_and_the_paired_difference(tmp_path):
    table = cells(written(tmp_path), "held-out")
    assert table[2] == [
        "env1", "20 × 3", "0.800", "0.900", "+0.100 +0.050 to +0.150",
        "0.050", "0.050", "0.000 −0.100 to +0.100", "0.600", "0.400", "−0.200 −0.300 to −0.100",
    ]  # fmt: skip
    assert [line[0] for line in table[2:]] == ["env1", "fresh", "all"]


def test_one_map_has_one_line_and_perhaps_no_interval(tmp_path):
    rows = {"env1": row(ALONE, ALONE), "all": row(ALONE, ALONE)}
    (line,) = cells(written(tmp_path, held_out=rows), "held-out")[2:]
    assert line[:2] == ["env1", "1"]
    assert line[4] == "+0.100"


def test_the_race_says_who_was_dropped_and_why(tmp_path):
    path = written(tmp_path)
    assert cells(path, "rungs")[1:] == [
        ["Search", "env1 1, fresh 1", "6", "1", "1", "trial 1 0.800", "0.500"],
        ["Rung 1", "env1 2, fresh 2", "4", "1", "1", "trial 3 0.600", "0.550"],
        ["Rung 2", "env1 4, fresh 3", "2", "–", "–", "trial 3 0.650", "0.600"],
    ]
    assert cells(path, "candidates")[1:] == [
        ["trial 3", "0.700", "0.600", "0.650", "winner"],
        ["published (start)", "0.500", "0.550", "0.600", "finished"],
        ["trial 2", "0.600", "0.500", "–", "outranked"],
        ["trial 1", "0.800", "0.400", "–", "worse beyond the noise"],
    ]


def test_a_race_without_the_start_has_no_column_for_it(tmp_path):
    rungs = [
        Rung(rung.places, {n: value for n, value in rung.values.items() if n != START}, rung.worse)
        for rung in RACE.rungs
    ]
    path = written(tmp_path, race=Race(tuple(rungs), {}))
    assert cells(path, "rungs")[0][-1] == "Best so far"
    assert "The start stays" not in path.read_text(encoding="utf-8")


def test_without_a_race_the_page_says_so(tmp_path):
    text = written(tmp_path, race=None, importances={}).read_text(encoding="utf-8")
    assert "There was no race" in text
    assert text.count("<img") == 1  # of the parameters
    assert "PED-ANOVA" not in text


def test_where_the_start_wins_the_best_trial_is_still_shown(tmp_path):
    path = written(tmp_path, winner=START, best=2)
    assert cells(path, "held-out")[0] == ["Map", "Episodes", "Success", "Collision", "Reward"]
    assert cells(path, "parameters")[0][:3] == ["Parameter", "Start", "Trial 2"]
    assert "where the start succeeded" not in path.read_text(encoding="utf-8")


def test_parameters_have_their_values_ranges_and_importance(tmp_path):
    path = written(tmp_path)
    assert cells(path, "parameters")[1:] == [
        ["c_ o", "2000 outside the range", "1", "1 to 1000, log", "0.75"],
        ["planner. kp", "–", "2", "0 to 4", "0.25"],
    ]


@pytest.mark.parametrize("race", [RACE, None], ids=["race", "no race"])
def test_pictures_of_a_sample_say_so(tmp_path, monkeypatch, race):
    assert "the picture shows" not in written(tmp_path, race=race).read_text(encoding="utf-8")
    monkeypatch.setattr(pictures, "MOST_DRAWN", 2)
    text = written(tmp_path, race=race).read_text(encoding="utf-8")
    raced = "raced or " if race else ""
    assert f"Of 5, the picture shows one in 3, and each that {raced}was the best so far" in text
    assert ("Of 6, the picture shows one in 3, and each that raced;" in text) == (race is not None)


def test_the_pictures_are_within_the_page(tmp_path):
    text = written(tmp_path).read_text(encoding="utf-8")
    pictures = [b64decode(data) for data in re.findall(r'src="data:image/svg\+xml;base64,([^"]+)"', text)]
    assert len(pictures) == 2
    assert all(b"<svg" in picture and b"http-equiv" not in picture for picture in pictures)


def test_the_worst_worlds_link_to_pages_that_exist(tmp_path):
    (tmp_path / "env1" / "explain").mkdir(parents=True)
    (tmp_path / "env1" / "explain" / "7-2.html").write_text("")
    path = written(tmp_path)
    assert 'href="env1/explain/7-2.html"' in path.read_text(encoding="utf-8")
    assert cells(path, "worst")[1:] == [
        ["env1 7 why", "collision", "−0.200", "12.0", "3 of 3", "0 of 3 start was better"],
        ["fresh 8", "success", "−0.200", "12.0", "0 of 3", "0 of 3"],
    ]
    assert "3 of 120 episodes failed, 2 of them where the start succeeded." in path.read_text(
        encoding="utf-8"
    )


def test_the_same_report_gives_the_same_bytes(tmp_path):
    assert written(tmp_path).read_bytes() == written(tmp_path).read_bytes()


@pytest.fixture
def hostile(tmp_path):
    """A page on which every name is markup."""
    key = f"planner.{HOSTILE}"
    trials = [trial._replace(values={key: trial.reward}) for trial in TRIALS]
    rungs = [
        Rung(tuple((HOSTILE, n) for _, n in rung.places), rung.values, rung.worse) for rung in RACE.rungs
    ]
    return written(
        tmp_path, title=HOSTILE, facts=HOSTILE, sentence=f"Better: {HOSTILE}", start=HOSTILE[:19],
        training_worlds=HOSTILE, held_out={HOSTILE: row(), "all": row()}, race=Race(tuple(rungs), {}), trials=trials,
        space={key: Range(-1.0, 1.0)},
        start_values={key: 0.5}, importances={key: 1.0}, commands={HOSTILE: HOSTILE},
        worst=[world(tmp_path / HOSTILE.replace("/", ""), 1, HOSTILE)],
    )  # fmt: skip


def test_names_are_only_text(hostile, open_page):  # noqa: F811
    text = hostile.read_text(encoding="utf-8")
    assert not re.search(r"<img src=x|<script>alert|https?:", text)
    page = open_page(hostile)
    assert page.locator("h1").inner_text() == HOSTILE
    assert page.watch.said == []
    assert page.watch.strangers() == []


@pytest.mark.parametrize("width", [400, 1200, 1600])
def test_the_page_fits_any_window_in_both_themes(tmp_path, open_page, width):  # noqa: F811
    page = open_page(written(tmp_path), width=width)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    before = page.evaluate("getComputedStyle(document.body).backgroundColor")
    page.get_by_role("button", name="Switch between light and dark").click()
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") != before
    assert page.watch.said == []
    assert page.watch.strangers() == []


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
        expected = [2]
        for measure in ("success", "collision", "reward"):
            expected += [each[measure] - each[f"{measure}_difference"][0], each[measure]]
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
