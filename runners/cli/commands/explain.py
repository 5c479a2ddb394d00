"""Show why the robot went where it went: failures worst first, a page for each episode, or sentences."""

from __future__ import annotations

import argparse
import math
import shutil
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runners.cli.help import add_trust, texts

if TYPE_CHECKING:
    from runners.records.episode_record import EpisodeKey
    from runners.workers.trace import Trace, TracedStep

EXAMPLES = (
    "lme explain outputs/eval/RUN",
    "lme explain outputs/eval/RUN 218",
    "lme explain outputs/eval/RUN 218/2 --output why.html",
    "lme explain outputs/eval/RUN failures",
    "lme explain outputs/eval/RUN 218 --text",
    "lme explain goal-1.mcap",
)


def main(argv: list[str]) -> int:
    """List the failures of a run, worst first, or explain the named episodes or a recording. Raises InputError."""
    arguments = _parser().parse_args(argv)
    if arguments.run.suffix.lower() == ".mcap":
        _recording(arguments.run, arguments.episodes, arguments.output, arguments.text)
        return 0
    run_dir = _one_run(arguments.run)
    if not arguments.episodes:
        _list(run_dir)
    elif arguments.text:
        _print_reasons(run_dir, arguments.episodes)
    else:
        _draw(run_dir, arguments.episodes, arguments.output)
    return 0


def _parser() -> argparse.ArgumentParser:
    notes = "Episodes are driven once more, and must repeat what was recorded."
    parser = argparse.ArgumentParser(prog="lme explain", **texts(__doc__, EXAMPLES, notes))
    run_help = "a run's directory, that of a sweep's job, or a recording"
    parser.add_argument("run", type=Path, metavar="RUN", help=run_help)
    parser.add_argument(
        "episodes",
        nargs="*",
        metavar="EPISODE",
        help="WORLD (its run 0), WORLD/RUN or failures; none: say what happened in those that "
        "failed, worst first: collisions by speed, then falls, then time-outs by the distance to the goal",
    )
    output_choice = parser.add_mutually_exclusive_group()
    output_choice.add_argument(
        "--output",
        type=Path,
        metavar="PATH",
        help="an .html file for one episode, or a folder; default: RUN/explain/, or next to the recording",
    )
    output_choice.add_argument(
        "--text", action="store_true", help="print the sentences instead of making a page"
    )
    add_trust(parser)
    return parser


def _recording(path: Path, words: Sequence[str], output: Path | None, text: bool) -> None:
    """Explain a recording by `lme eval` or `lme live`, on the terminal or as a page."""
    from lme.errors import InputError
    from runners.recordings.own_recordings import retrace
    from runners.records.atomic_write import output_path
    from runners.reports.explainer.encode import episode_title
    from runners.reports.explainer.pages import make_folder
    from runners.reports.explainer.write import write_page
    from runners.workers.trace import Drive

    if words:
        raise InputError(f"{words[0]}: a recording holds one drive; omit the episode")
    # Repeat the decisions of the recording, then print or draw them.
    trace = retrace(path)
    if text:
        print("\n".join(_episode_lines(episode_title(trace).capitalize(), trace, {})))
        return
    page_path = path.with_suffix(".html")
    if output is not None:
        html_path = output if output.suffix == ".html" else output / page_path.name
        page_path = output_path(html_path, "--output")
    make_folder(page_path.parent)
    write_page(trace, page_path, play="" if isinstance(trace.episode, Drive) else path.name)
    print(page_path)


def _one_run(path: Path) -> Path:
    """Return the run directory. Raises InputError for several runs, after printing each with its command."""
    from lme.errors import InputError
    from runners.records.launch_record import read_launch
    from runners.records.records import find_runs

    runs = find_runs([path])
    if runs == [path]:
        return path
    for run in runs:
        launch = read_launch(run)
        print(run if launch is None else f"{run}  {launch.command_line}")
    raise InputError(f"{path} holds {len(runs)} runs: give one of them")


def _list(run_dir: Path) -> None:
    """Print what happened in the failed episodes, worst first, and the commands that explain them."""
    from runners.config.quoting import lme_command
    from runners.records.launch_record import trust_flags
    from runners.records.records import read_episodes
    from runners.reports.analysis.failures import episode_rows, is_failure
    from runners.reports.analysis.what_happened import ORDER

    episodes = read_episodes([run_dir])
    failed = [episode for _, episode in episode_rows(episodes[is_failure(episodes)])]
    if failed:
        print("\n".join([*_lines(failed), *[ORDER] * (len(failed) > 1)]))
    successes = len(episodes) - len(failed)
    if successes:
        num_successes = f"{successes} episodes" if successes > 1 else "1 episode"
        print(f"{num_successes} reached the goal" + "; you can explain any of them, too" * bool(failed))
    # Print commands for an example, which is the worst failure if there is one.
    example = failed[0] if failed else episodes.iloc[0]
    episode = f"{example['world']}/{example['run']}"
    trust = trust_flags(run_dir)
    print(
        f"\n{'The worst:' if failed else 'One of them:':<19} {lme_command('explain', run_dir, episode, *trust)}"
    )
    print(f"In words:           {lme_command('explain', run_dir, episode, '--text', *trust)}")
    if failed:
        print(f"All that failed:    {lme_command('explain', run_dir, 'failures', *trust)}")


def _lines(episodes: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the episodes as an aligned table, whose last column is wrapped to the terminal."""
    from runners.reports.analysis.tables import aligned

    rows = [("episode", "outcome", "time [s]", "")]
    for episode in episodes:
        time = episode.get("time_s", math.nan)
        rows.append((f"{episode['world']}/{episode['run']}", episode["outcome"], f"{time:.1f}", ""))
    lines = aligned(rows, right=(2,))
    indent = max(map(len, lines)) + 2
    width = max(shutil.get_terminal_size((10_000, 0)).columns, indent + 40)
    texts = ["what happened", *(episode["what_happened"] for episode in episodes)]
    return [
        line.ljust(indent) + textwrap.fill(text, width - indent).replace("\n", "\n" + " " * indent)
        for line, text in zip(lines, texts, strict=True)
    ]


def _draw(run_dir: Path, words: Sequence[str], output: Path | None) -> None:
    """Make the pages and print their paths. Pages in the run directory are added to its MLflow run."""
    from lme.errors import InputError
    from runners.records.records import read_episodes
    from runners.reports.analysis.failures import FOLDER
    from runners.reports.explainer import pages
    from runners.tracking.mlflow import add_files
    from runners.workers.executor import ProcessConfig, ProcessExecutor, WorkerDiedError

    # Make the page of each episode, several of them in worker processes.
    episodes = pages.select_episodes(read_episodes([run_dir]), words)
    page_paths = _page_paths(run_dir, pages.keys_of(episodes), output)
    executor = ProcessExecutor(ProcessConfig(workers=None))
    try:
        results = sorted(pages.make_pages(run_dir, episodes, page_paths, executor))
    except WorkerDiedError as error:
        raise InputError(f"{str(error).partition(':')[0]}: explain fewer episodes at once") from None
    # Say where the pages are, also if some could not be made.
    made_paths = [page.path for page in results if not page.problem]
    for path in made_paths:
        print(path)
    if output is None and made_paths:
        add_files(run_dir, [*made_paths, pages.index(run_dir)], FOLDER)
    problems = [page.problem for page in results if page.problem]
    if problems:
        raise InputError(problems[0])


def _page_paths(run_dir: Path, keys: Sequence[EpisodeKey], output: Path | None) -> dict[EpisodeKey, Path]:
    """Return the path of each page. Raises InputError if one file is given for several pages."""
    from lme.errors import InputError
    from runners.records.atomic_write import output_path
    from runners.reports.analysis.failures import page_path

    if output is None:
        return {key: page_path(run_dir, key) for key in keys}
    if output.suffix != ".html" or output.is_dir():
        return {key: output / page_path(run_dir, key).name for key in keys}
    if len(keys) > 1:
        raise InputError(f"--output {output}: one file cannot hold {len(keys)} pages; give a folder")
    return dict.fromkeys(keys, output_path(output, "--output"))


def _print_reasons(run_dir: Path, words: Sequence[str]) -> None:
    """Print the reason of every decision; equal decisions in a row share a line."""
    from runners.records.records import read_episodes, read_trajectories
    from runners.reports.explainer.pages import keys_of, select_episodes
    from runners.workers.trace import rerun_recorded

    trajectories = read_trajectories([run_dir])
    episodes = select_episodes(read_episodes([run_dir]), words)
    records = episodes.to_dict("records")
    for number, (key, record) in enumerate(zip(keys_of(episodes), records, strict=True)):
        trace = rerun_recorded(run_dir, key.world, key.run, trajectories)
        print("\n" * (number > 0) + "\n".join(_episode_lines(str(key).capitalize(), trace, record)))


def _episode_lines(name: str, trace: Trace, record: Mapping[str, Any]) -> list[str]:
    """Return lines that say how a drive ended, what happened in it, and why each decision was made."""
    from runners.reports.explainer.write import account

    outcome = f"{trace.episode.outcome} after {trace.episode.time:.1f} s"
    lines = [f"{name}: {outcome}, {len(trace.steps)} decisions", f"It {account(trace, record)}."]
    return [*lines, *_sentences(trace.steps)]


def _sentences(steps: Sequence[TracedStep]) -> Iterator[str]:
    """Yield the step, time and reason of each decision. Raises InputError if the guide gives no reasons."""
    from lme.errors import InputError
    from lme.guides.lme.explanation import reasons

    explanations = [step.explanation for step in steps if step.explanation is not None]
    if not explanations:
        raise InputError(
            "--text: only guide=lme and guide=lme_plus give reasons; without --text the page shows the drive"
        )
    yield f"{'step':>11}  {'time [s]':>13}  why"
    for start, end, text in reasons(explanations):
        numbers, times = f"{start}", f"{steps[start].time:.1f}"
        if end > start:
            numbers, times = f"{numbers}–{end}", f"{times}–{steps[end].time:.1f}"
        yield f"{numbers:>11}  {times:>13}  {text}"
