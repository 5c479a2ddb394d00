"""Explainer pages of a run: the choice of episodes, the places of their pages, and the making of them."""

from __future__ import annotations

import hashlib
import json
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from lme.errors import InputError
from runners.config.schema import Explain
from runners.records import launch_record, trust
from runners.records.episode_record import EpisodeKey
from runners.records.records import read_episodes, read_trajectories
from runners.reports.analysis.failures import folder, is_failure, page_path, refuse_link
from runners.workers.executor import SerialConfig, SerialExecutor
from runners.workers.progress import EpisodeProgress

if TYPE_CHECKING:
    import pandas as pd

_NEAREST = 3  # worlds that an error names
_MARK = "<!-- episode {} -->\n"


class Page(NamedTuple):
    """The result of making a page. problem: the reason for a failure; empty on success."""

    key: EpisodeKey
    path: Path
    problem: str


@dataclass(frozen=True, slots=True)
class PagePayload:
    """The input of a worker that makes pages of a run.

    places: path of each page. marks: identify the episode of each page. records: rows of `episodes.parquet`. trusted:
    whether code that the run names may be executed.
    """

    run_dir: Path
    places: Mapping[EpisodeKey, Path]
    marks: Mapping[EpisodeKey, str]
    records: Mapping[EpisodeKey, Mapping[str, Any]]
    trusted: bool


def make_requested_pages(requested: Explain, run_dir: Path, executor: Any) -> None:
    """Make the pages that `explain=` asks for, and their index. Existing pages are kept.

    Warns once of pages that could not be made. Raises InputError if their folder or the index cannot be written.
    """
    if requested is Explain.none:
        return
    episodes = read_episodes([run_dir])
    if requested is Explain.failures:
        episodes = episodes[is_failure(episodes)]
    paths = {key: page_path(run_dir, key) for key in keys_of(episodes)}
    pages = list(make_pages(run_dir, episodes, paths, executor, keep=True))
    # The index also needs to be written if only older pages are there.
    if any(not page.problem for page in pages) or folder(run_dir):
        index(run_dir)
    elif not pages:
        print(f"explain={requested}: no episode failed, so there is no page")
    warn_of_problems(pages)


def warn_of_problems(pages: Sequence[Page]) -> None:
    """Warn once if some of the pages could not be made."""
    problems = [page.problem for page in pages if page.problem]
    if problems:
        warnings.warn(f"{len(problems)} of {len(pages)} pages were not made: {problems[0]}", stacklevel=3)


def keys_of(episodes: pd.DataFrame) -> list[EpisodeKey]:
    """Return the key of every row."""
    return [
        EpisodeKey(int(world), int(run))
        for world, run in zip(episodes["world"], episodes["run"], strict=True)
    ]


def select_episodes(episodes: pd.DataFrame, words: Sequence[str]) -> pd.DataFrame:
    """Return the episodes that the words name, each once, in order.

    Words are "WORLD" (its run 0), "WORLD/RUN" or "failures". Raises InputError for an episode that does not exist,
    and names the nearest worlds.
    """
    available, selected = keys_of(episodes), []
    for word in words:
        selected += keys_of(episodes[is_failure(episodes)]) if word == "failures" else [_key(word, available)]
    if not selected:
        raise InputError("failures: no episode of this run failed; name one by its world")
    # Each episode once, in the order of the words.
    by_key = episodes.set_index(["world", "run"], drop=False)
    return by_key.loc[[(key.world, key.run) for key in dict.fromkeys(selected)]].reset_index(drop=True)


def make_pages(
    run_dir: Path,
    episodes: pd.DataFrame,
    paths: Mapping[EpisodeKey, Path],
    executor: Any,
    keep: bool = False,
) -> Iterator[Page]:
    """Write the page of each episode to its place; yield results as they finish.

    keep: whether to skip a page that exists. Several pages are made by `executor`, with a progress bar; a single page
    is made in this process.
    """
    # A page that bears the mark of its episode is up to date.
    marks = _marks(run_dir, episodes)
    outcomes = dict(zip(keys_of(episodes), episodes["outcome"], strict=True))
    up_to_date = [key for key in paths if keep and _has_mark(paths[key], marks[key])]
    yield from (Page(key, paths[key], "") for key in up_to_date)
    remaining = [key for key in paths if key not in up_to_date]
    # Make the folders, which must not be links, then the pages.
    for path in {paths[key].parent for key in remaining}:
        refuse_link(path, run_dir)
        make_folder(path)
    records = dict(zip(keys_of(episodes), episodes.to_dict("records"), strict=True))
    payload = PagePayload(run_dir, dict(paths), marks, records, trust.is_trusted(run_dir))
    if len(remaining) <= 1:
        yield from SerialExecutor(SerialConfig()).map(initialise, payload, remaining)
        return
    with EpisodeProgress("Pages", len(remaining)) as progress:
        for page in executor.map(initialise, payload, remaining):
            progress.add(outcomes[page.key])
            yield page


def initialise(payload: PagePayload) -> Callable[[EpisodeKey], Page]:
    """Return the function that makes one page, for a worker process."""
    from runners.reports.explainer.write import write_page
    from runners.workers.trace import rerun_recorded

    run_dir = payload.run_dir

    def make(key: EpisodeKey) -> Page:
        path = payload.places[key]
        try:
            # Drive the episode again, and end the page with its mark, so that an incomplete page has none.
            mark = _MARK.format(payload.marks[key])
            with trust.trusting(run_dir) if payload.trusted else nullcontext():
                trace = rerun_recorded(run_dir, key.world, key.run, read_trajectories([run_dir], [key]))
            record = payload.records[key]
            write_page(trace, path, record["system"], mark, f"RUN {key.world}/{key.run}", record)
        except (InputError, OSError) as error:
            return Page(key, path, str(error))
        return Page(key, path, "")

    return make


def index(run_dir: Path) -> Path:
    """Write the index of a run's pages again, and return its path."""
    from runners.reports.explainer.write import write_index

    return write_index(read_episodes([run_dir]), run_dir)


def _key(word: str, available: Sequence[EpisodeKey]) -> EpisodeKey:
    world_word, _, run_word = word.partition("/")
    if not world_word.isdigit() or not (run_word or "0").isdigit():
        raise InputError(
            f"{word!r} is not an episode: give WORLD, WORLD/RUN or failures, such as "
            f"{available[0].world}/{available[0].run}"
        )
    world, run = int(world_word), int(run_word or 0)
    runs = sorted(key.run for key in available if key.world == world)
    if not runs:
        worlds = sorted({key.world for key in available}, key=lambda number: (abs(number - world), number))
        nearest = ", ".join(map(str, sorted(worlds[:_NEAREST])))
        those = "the nearest is" if len(worlds) == 1 else "those nearest to it are"
        raise InputError(f"world {world} was not driven in this run: {those} {nearest}")
    if run not in runs:
        raise InputError(f"world {world} has no run {run}: it has {', '.join(map(str, runs))}")
    return EpisodeKey(world, run)


def _marks(run_dir: Path, episodes: pd.DataFrame) -> dict[EpisodeKey, str]:
    """Return a hash for each episode, made from the run's config and from how the episode ended."""
    launch = launch_record.read_launch(run_dir)
    config = launch.fingerprint if launch is not None else ""
    columns = [name for name in ("steps", "path_length_m", "final_distance_m") if name in episodes]
    final_values = episodes[["outcome", *columns]].itertuples(index=False)
    return {
        key: hashlib.sha256(
            json.dumps([config, key.world, key.run, *row_values], default=str).encode()
        ).hexdigest()[:16]
        for key, row_values in zip(keys_of(episodes), final_values, strict=True)
    }


def _has_mark(path: Path, mark: str) -> bool:
    """Return whether the file is a complete page of the episode with this mark."""
    mark_bytes = _MARK.format(mark).encode()
    try:
        with path.open("rb") as page:
            page.seek(-len(mark_bytes), 2)
            return page.read() == mark_bytes
    except OSError:
        return False


def make_folder(path: Path) -> None:
    """Make a folder for pages. Raises InputError."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{path}: cannot be made ({error.strerror}): choose another folder") from error
