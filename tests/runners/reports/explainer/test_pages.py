"""Pages of a run's episodes: which, where, linked from where; and what `lme explain` says."""

import base64
import gzip
import html
import json
import re
import shutil

import pandas as pd
import pytest

from lme.errors import InputError
from lme.guides.lme.explanation import reason
from lme.guides.lme_plus.criteria import CRITERIA as PLUS_CRITERIA
from lme.navigation.episode import TRAJECTORY_COLUMNS
from runners.cli.main import main
from runners.config.schema import Explain
from runners.records import launch_record
from runners.records.episode_record import COLUMNS, EpisodeKey, EpisodeRecord, EpisodeResult
from runners.records.records import RecordWriter, read_episodes, read_trajectories
from runners.reports.analysis.failures import failed_section, folder
from runners.reports.explainer import pages, write
from runners.reports.explainer.encode import encode
from runners.reports.explainer.write import write_index
from runners.workers.executor import SerialConfig, SerialExecutor
from runners.workers.trace import rerun, rerun_recorded
from tests.made_runs import write_run

pytestmark = pytest.mark.usefixtures("undrawn")

# In eight seconds world 230 is driven and world 207 is not.
FEW, SHORT = "map.worlds=[207,230]", "map.time_limit=8"
WORDS = ["eval", "sim=fast", "runs=1", "executor=serial", "tracking=none"]
FAILED, ARRIVED = EpisodeKey(207, 0), EpisodeKey(230, 0)


@pytest.fixture(scope="module")
def driven(tmp_path_factory):
    """A run with the pages that explain=failures makes."""
    run_dir = tmp_path_factory.mktemp("explained") / "run"
    assert main([*WORDS, FEW, SHORT, "explain=failures", f"hydra.run.dir={run_dir}"]) == 0
    return run_dir


@pytest.fixture
def run(driven, tmp_path):
    """A copy of it to do as one likes with."""
    return shutil.copytree(driven, tmp_path / "run")


@pytest.fixture
def drawn(monkeypatch):
    """Episodes of which a page is made, and no pages worth the name."""
    made = []

    def write_page(trace, path, system, ending, play, record):
        made.append(EpisodeKey(trace.world, trace.run))
        path.write_text(f"<!doctype html>{system}\n{play}\n{ending}")

    monkeypatch.setattr(write, "write_page", write_page)
    return made


def files(run_dir):
    return sorted(path.name for path in (run_dir / "explain").iterdir())


def links(text):
    return re.findall(r'\]\(([^)]+)\)|href="([^"]+)"', text)


# --- lme eval explain=… ----------------------------------------------------------------------------------


def test_failures_have_a_page_and_the_table_leads_to_it(driven):
    assert files(driven) == ["207-0.html", "index.html"]
    table = (driven / "table.md").read_text()
    assert re.search(
        r"\| 207 \| 0 \| timeout \| 8\.0 \| \d+\.\d\d \| was still on its way, \d.+ \| "
        r"\[\S+\]\(explain/207-0\.html\) \|",
        table,
    )
    assert "| 230 |" not in table
    targets = [one or other for one, other in links(table)]
    assert targets == ["explain/207-0.html", "explain/index.html"]
    assert all((driven / target).is_file() for target in targets)


def test_the_closest_approach_is_that_of_the_path(driven):
    steps = read_trajectories([driven])
    path = steps[steps["world"] == 207]
    episode = read_episodes([driven]).set_index("world").loc[207]
    closest = (
        (path["x_m"] - episode["goal_x_m"]) ** 2 + (path["y_m"] - episode["goal_y_m"]) ** 2
    ).min() ** 0.5
    assert f"| {closest:.2f} |" in (driven / "table.md").read_text()


def test_the_page_is_of_the_episode_and_needs_no_other_file(driven):
    page = (driven / "explain" / "207-0.html").read_text(encoding="utf-8")
    assert "<title>" in page
    assert not re.search(r'(src|href)="(https?:)?//', page)
    index = (driven / "explain" / "index.html").read_text(encoding="utf-8")
    assert [other for _, other in links(index)] == ["207-0.html"]
    assert "<td>LME</td><td>0.500</td>" in index
    assert not re.search(r"https?:|<script", index)


def test_names_in_the_index_are_text_and_nothing_else(run, drawn):
    name = '{{RUN}}"><script>alert("1")</script><img src=x onerror=alert(1)>'
    named = ["system", "ablation", "weights", "robot", "map", "subset"]
    frame = read_episodes([run]).assign(**dict.fromkeys(named, name))
    text = write_index(frame, run).read_text(encoding="utf-8")
    assert html.escape(name) in text
    assert "{{" not in text.replace(html.escape(name), "")
    assert not re.search("<script|<img", text)


def test_explaining_more_continues_the_same_run_and_keeps_its_pages(run, drawn):
    before = (run / "explain" / "207-0.html").read_bytes()
    assert main([*WORDS, FEW, SHORT, "explain=all", f"hydra.run.dir={run}", "resume=true"]) == 0
    assert drawn == [ARRIVED]
    assert (run / "explain" / "207-0.html").read_bytes() == before
    index = (run / "explain" / "index.html").read_text(encoding="utf-8")
    assert [other for _, other in links(index)] == ["207-0.html", "230-0.html"]  # failures first
    assert index.index("was still on its way") < index.index("reached the goal after")


@pytest.mark.parametrize(
    "spoil_page", [lambda page: page[:-30], lambda page: page.replace(b"<!-- ", b"<!-- not ")]
)
def test_a_page_that_is_torn_or_of_another_episode_is_replaced(run, drawn, spoil_page):
    page = run / "explain" / "207-0.html"
    page.write_bytes(spoil_page(page.read_bytes()))
    pages.make_requested_pages(Explain.failures, run, SerialExecutor(SerialConfig()))
    assert drawn == [FAILED]


def test_explain_none_makes_no_page(run, drawn):
    shutil.rmtree(run / "explain")
    pages.make_requested_pages(Explain.none, run, SerialExecutor(SerialConfig()))
    assert drawn == []
    assert folder(run) == []


def test_where_nothing_failed_there_is_nothing_to_see(tmp_path, capsys):
    assert main([*WORDS, "map.worlds=[230]", SHORT, "explain=failures", f"hydra.run.dir={tmp_path}"]) == 0
    out = capsys.readouterr().out
    assert "explain=failures: no episode failed, so there is no page" in out
    assert "Why the" not in out
    assert not (tmp_path / "explain").exists()


def test_a_run_with_failures_and_no_pages_ends_with_the_command_that_explains_them(tmp_path, capsys):
    assert main([*WORDS, FEW, SHORT, f"hydra.run.dir={tmp_path}"]) == 0
    line, _ = capsys.readouterr().out.splitlines()[-2:]
    assert line == f"Why the episode failed, worst first: lme explain {tmp_path}"
    assert main(line.partition("lme ")[2].split()) == 0
    assert "timeout" in capsys.readouterr().out


def test_a_page_calls_the_system_what_the_table_calls_it(tmp_path, drawn):
    words = [SHORT, "guide=target", "planner=dwa_tuned", "map.worlds=[207]", f"hydra.run.dir={tmp_path}"]
    assert main([*WORDS, *words, "explain=all"]) == 0
    system = read_episodes([tmp_path]).loc[0, "system"]
    assert (tmp_path / "explain" / "207-0.html").read_text().startswith(f"<!doctype html>{system}\n")


def test_pages_that_cannot_be_made_are_one_warning_of_a_finished_run(run, drawn, says):
    shutil.rmtree(run / "explain")
    spoil(run)
    with says.warns() as caught:
        pages.make_requested_pages(Explain.all, run, SerialExecutor(SerialConfig()))
    assert len(caught) == 1
    assert files(run) == ["230-0.html", "index.html"]


def test_an_episode_whose_steps_were_deleted_is_explained(run, drawn, capsys, says):
    assert main(["explain", str(run), "207", "--text"]) == 0
    before = capsys.readouterr()
    (run / "trajectories.parquet").unlink()
    assert main(["explain", str(run), "207", "--text"]) == 0
    assert capsys.readouterr() == before
    pages.make_requested_pages(Explain.all, run, SerialExecutor(SerialConfig()))
    assert drawn == [ARRIVED]  # the other page is there
    records = pd.read_parquet(run / "episodes.parquet")
    records.assign(path_length_m=1.0).to_parquet(run / "episodes.parquet")
    assert main(["explain", str(run), "207", "--text"]) == 2
    says(capsys.readouterr().err)


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("explain", ["{run}", "207", "--text"]),
        ("explain", ["{run}"]),
        ("figure", ["features", "run={run}"]),
        ("table", ["{run}"]),
        ("compare", ["{run}/../other", "{run}"]),
        ("eval", ["resume={run}"]),
        ("play", ["{run}"]),
    ],
)
def test_a_damaged_launch_record_is_called_damaged(run, driven, monkeypatch, command, words, capsys, says):
    shutil.copytree(driven, run.parent / "other")
    monkeypatch.chdir(run.parent)
    (run / "launch.json").write_text("{")
    assert main([command, *(word.format(run=run) for word in words)]) == 2
    error = capsys.readouterr().err
    says(error)
    assert error.count("\n") == 1


def test_a_record_of_no_episode_is_refused(run, says):
    with says.raises(InputError):
        rerun_recorded(run, 9, 0, read_trajectories([run]))


def spoil(run_dir):
    """Let world 207 have gone another way."""
    import pyarrow.parquet as pq

    path = run_dir / "trajectories.parquet"
    steps = pq.ParquetFile(path).read().to_pandas()
    steps.loc[steps["world"] == 207, "x_m"] += 0.5
    steps.to_parquet(path, index=False)


def test_table_rebuilds_the_links_of_the_pages_that_are_there(run, capsys):
    before = (run / "table.md").read_text()
    assert main(["table", str(run)]) == 0
    assert (run / "table.md").read_text() == before
    (run / "explain" / "207-0.html").unlink()
    assert main(["table", str(run)]) == 0
    assert (run / "table.md").read_text() == before.partition("\n## Failed")[0]


def test_a_sweeps_table_leads_into_its_jobs(driven, tmp_path):
    for number in "01":
        job = shutil.copytree(driven, tmp_path / number)
        launch = launch_record.read_launch(job)
        launch.overrides = ["runs=1", f"ablation={'none' if number == '0' else 'no_c_o'}"]
        launch.write(job)
    (tmp_path / "1" / "explain" / "207-0.html").unlink()
    section = failed_section(read_episodes([tmp_path / "0", tmp_path / "1"]), tmp_path)
    rows = [line.split(" | ") for line in section.splitlines() if "207" in line]
    assert [row[0] for row in rows] == ["| 0 ablation=none", "| 1 ablation=no_c_o"]
    assert [row[-1] for row in rows] == ["[0/explain/207-0.html](0/explain/207-0.html) |", "– |"]
    assert "All pages: [0/explain/index.html]" in section


# --- lme explain -----------------------------------------------------------------------------------------


def test_without_an_episode_failures_are_listed_and_the_others_counted(driven, capsys, says, monkeypatch):
    monkeypatch.setenv("COLUMNS", "1000")  # so that no sentence is wrapped
    assert main(["explain", str(driven)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[:2] for line in lines[:2]] == [["episode", "outcome"], ["207/0", "timeout"]]
    says(lines[2])
    assert any(line.endswith(f"lme explain {driven} 207/0 --text") for line in lines)


def test_of_a_run_without_failures_the_first_episode_is_named(tmp_path, capsys, says):
    write_run(tmp_path, worlds=(200, 202))
    assert main(["explain", str(tmp_path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    says(lines[0])
    assert lines[2].endswith(f"lme explain {tmp_path} 200/0")
    assert not any("All that failed" in line for line in lines)


def test_records_without_later_columns_are_listed_too(run, capsys):
    path = run / "episodes.parquet"
    pd.read_parquet(path).drop(columns=["contact_part", "time_s"]).to_parquet(path)
    assert main(["explain", str(run)]) == 0
    cells = map(str.split, capsys.readouterr().out.splitlines())
    assert ["207/0", "timeout", "nan"] in [words[:3] for words in cells]


def test_failures_are_listed_worst_first_and_wrapped_to_the_terminal(run, monkeypatch, capsys):
    path = run / "episodes.parquet"
    rows = [
        {"world": 207, "outcome": "timeout", "final_distance_m": 9.0},
        {"world": 208, "outcome": "timeout", "final_distance_m": 9.5},
        {"world": 209, "outcome": "collision", "contact_part": "front left", "final_distance_m": 1.0},
    ]
    template = pd.read_parquet(path).iloc[:1]
    pd.concat([template.assign(**row) for row in rows]).to_parquet(path)
    monkeypatch.setenv("COLUMNS", "80")
    assert main(["explain", str(run)]) == 0
    out = capsys.readouterr().out
    table, order, rest = out.partition("Worst first: ")
    assert re.findall(r"^(\d+)/0 ", table, re.MULTILINE) == ["209", "208", "207"]
    assert max(map(len, table.splitlines())) <= 80
    assert "hit an obstacle with its front left" in table
    assert order
    assert f"The worst:          lme explain {run} 209/0" in rest


def test_pages_lie_with_the_run_and_in_its_index(run, drawn, capsys):
    assert main(["explain", str(run), "230"]) == 0
    assert capsys.readouterr().out.split() == [str(run / "explain" / "230-0.html")]
    assert drawn == [ARRIVED]
    assert "230-0.html" in (run / "explain" / "index.html").read_text()
    assert main(["explain", str(run), "failures", "207/0"]) == 0  # the same one
    assert drawn == [ARRIVED, FAILED]


@pytest.mark.parametrize(
    ("output", "page"), [("why.html", "why.html"), ("new/folder", "new/folder/207-0.html")]
)
def test_a_page_elsewhere(run, drawn, tmp_path, output, page, capsys):
    assert main(["explain", str(run), "207", "--output", str(tmp_path / output)]) == 0
    assert capsys.readouterr().out.split() == [str(tmp_path / page)]
    assert (tmp_path / page).is_file()
    assert files(run) == ["207-0.html", "index.html"]


def test_two_pages_are_written_by_two_processes(run, tmp_path, capsys):
    assert main(["explain", str(run), "230", "207", "--output", str(tmp_path)]) == 0
    assert capsys.readouterr().out.split() == [str(tmp_path / f"{world}-0.html") for world in (207, 230)]
    assert (tmp_path / "207-0.html").read_bytes() == (run / "explain" / "207-0.html").read_bytes()


def test_text_explains_every_decision(driven, capsys, says):
    assert main(["explain", str(driven), "207", "--text"]) == 0
    title, story, header, *lines = capsys.readouterr().out.splitlines()
    steps = int(read_episodes([driven]).set_index("world").loc[207, "steps"])
    says(title)
    assert re.fullmatch(
        r"It was still on its way, .+ m from the goal, after .+ times the shortest way\.", story
    )
    assert header.split() == ["step", "time", "[s]", "why"]
    spans = [[int(step) for step in line.split()[0].split("–")] for line in lines]
    listed = [step for span in spans for step in range(span[0], span[-1] + 1)]
    assert listed == list(range(steps))
    says(lines[0])


@pytest.mark.parametrize(
    "words",
    [
        ["206"],
        ["207/3"],
        ["207.0"],
        ["207", "230", "--output", "one.html"],
    ],
    ids=" ".join,
)
def test_mistakes_are_named(driven, words, capsys, says):
    assert main(["explain", str(driven), *words]) == 2
    error = capsys.readouterr().err
    says(error)
    assert "Traceback" not in error


def test_a_run_without_failures_says_so(driven, says):
    episodes = read_episodes([driven])
    with says.raises(InputError):
        pages.select_episodes(episodes[episodes["outcome"] == "success"], ["failures"])


def test_a_folder_of_pages_that_leads_elsewhere_is_not_followed(run, tmp_path, capsys):
    run_dir, elsewhere = tmp_path / "copy", tmp_path / "elsewhere"
    shutil.copytree(run, run_dir)
    shutil.rmtree(run_dir / "explain", ignore_errors=True)
    elsewhere.mkdir()
    (run_dir / "explain").symlink_to(elsewhere)
    assert main(["explain", str(run_dir), "207"]) == 2
    assert "is a link to" in capsys.readouterr().err
    assert not list(elsewhere.iterdir())
    with pytest.raises(InputError, match="is a link to"):
        pages.index(run_dir)


def test_a_directory_of_several_runs_names_them(driven, capsys, says):
    shutil.copytree(driven, driven.parent / "sweep" / "0")
    shutil.copytree(driven, driven.parent / "sweep" / "1")
    assert main(["explain", str(driven.parent / "sweep"), "207"]) == 2
    said = capsys.readouterr()
    says(said.err)
    lines = said.out.splitlines()
    assert [line.partition(" ")[0] for line in lines] == [
        str(driven.parent / "sweep" / name) for name in "01"
    ]
    assert all(FEW in line and SHORT in line for line in lines)  # what each was started with


def test_a_run_of_another_version_is_refused_by_the_command(run, drawn, capsys, says):
    spoil(run)
    assert main(["explain", str(run), "207"]) == 2
    says(capsys.readouterr().err)
    assert files(run) == ["207-0.html", "index.html"]  # the old page, and no draft


def test_an_unfinished_run(driven, tmp_path, drawn):
    row = read_episodes([driven]).iloc[0]
    steps = read_trajectories([driven])
    trajectory = steps[steps["world"] == row["world"]][list(TRAJECTORY_COLUMNS)].to_numpy()
    record = EpisodeRecord(**row[list(COLUMNS)])
    with RecordWriter(tmp_path) as writer:
        writer.append(EpisodeResult(record, trajectory))
    launch_record.read_launch(driven).write(tmp_path)
    assert main(["explain", str(tmp_path), "failures"]) == 0
    assert drawn == [FAILED]


def test_a_guide_without_reasons_has_pages_but_no_sentences(tmp_path, capsys, says):
    words = [FEW, SHORT, "guide=target", "explain=failures", f"hydra.run.dir={tmp_path}"]
    assert main([*WORDS, *words]) == 0
    world, run = re.search(r"\| (\d+) \| (\d+) \|", (tmp_path / "table.md").read_text()).groups()
    assert f"{world}-{run}.html" in files(tmp_path)
    capsys.readouterr()
    assert main(["explain", str(tmp_path), world, "--text"]) == 2
    out, error = capsys.readouterr()
    assert out == ""
    says(error)


# --- the sentences of real drives ------------------------------------------------------------------------


@pytest.mark.parametrize("world", [207, 230])
def test_every_decision_of_a_real_drive_has_its_own_reason(driven, world):
    trace = rerun(launch_record.read_launch(driven).config, world, 0)
    before, texts = None, []
    for step in trace.steps:
        texts.append(reason(step.explanation, before))
        verdict = "switched: " if step.guidance.switched else "kept: "
        assert texts[-1].startswith(verdict if before else "first subgoal: ")
        before = step.explanation
    assert len(set(texts)) > len(texts) / 2
    assert sum(text.startswith("switched") for text in texts) == trace.episode.switches


def test_episodes_of_a_figure_are_explained_though_nothing_is_logged(run, drawn):
    note = run / ".hydra" / "config.yaml"
    note.write_text("seed: 0\n")
    assert main(["explain", str(run), "230"]) == 0
    assert drawn == [ARRIVED]


def test_lme_plus_has_pages_and_reasons_of_its_own(tmp_path, capsys):
    words = ["guide=lme_plus", "planner=min_time", "map.worlds=[207]", "explain=all", "map.time_limit=2"]
    assert main([*WORDS, *words, f"hydra.run.dir={tmp_path}"]) == 0
    assert "207-0.html" in files(tmp_path)
    capsys.readouterr()
    assert main(["explain", str(tmp_path), "207", "--text"]) == 0
    assert "first subgoal: the best of" in capsys.readouterr().out
    trace = rerun(launch_record.read_launch(tmp_path).config, 207, 0)
    head = header(encode(trace, [""] * len(trace.steps)))
    assert head["about"] == {
        name: criterion.__doc__.partition("\n")[0] for name, criterion in PLUS_CRITERIA.items()
    }


def header(text):
    """What stands before the arrays."""
    raw = gzip.decompress(base64.b64decode(text))
    return json.loads(raw[4 : 4 + int.from_bytes(raw[:4], "little")])
