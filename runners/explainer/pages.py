"""Explainer pages of a run: of which episodes, where they lie, and how they are made."""

from __future__ import annotations

import hashlib
import json
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from lme.errors import InputError
from runners.analysis.failures import Item, folder, is_failure, page_path
from runners.config.schema import Explain
from runners.records import run_directories
from runners.records.records import read_episodes, read_trajectories
from runners.workers.executor import SerialConfig, SerialExecutor
from runners.workers.progress import EpisodeProgress

if TYPE_CHECKING:
    import pandas as pd

_NEAREST = 3  # worlds that an error names
_MARK = "<!-- episode {} -->\n"


class Page(NamedTuple):
    """What became of a page. problem: why there is none; empty where there is one."""

    item: Item
    path: Path
    problem: str


def as_asked(which: Explain, run_dir: Path, executor: Any) -> None:
    """Make the pages that `explain=` asks for, and their index; those that are there already stay.

    Warns, once, of pages that could not be made. Raises InputError where the disk takes none.
    """
    if which is Explain.none:
        return
    episodes = read_episodes([run_dir])
    if which is Explain.failures:
        episodes = episodes[is_failure(episodes)]
    places = {item: page_path(run_dir, item) for item in items(episodes)}
    pages = list(make_pages(run_dir, episodes, places, executor, keep=True))
    if any(not page.problem for page in pages) or folder(run_dir):
        index(run_dir)
    elif not pages:
        print(f"explain={which}: no episode failed, so there is no page")
    missing = [page for page in pages if page.problem]
    if missing:
        warnings.warn(
            f"{len(missing)} of {len(pages)} pages were not made: {missing[0].problem}", stacklevel=2
        )


def items(episodes: pd.DataFrame) -> list[Item]:
    """(world, run) of every row."""
    return [(int(world), int(run)) for world, run in zip(episodes["world"], episodes["run"], strict=True)]


def chosen(episodes: pd.DataFrame, words: Sequence[str]) -> pd.DataFrame:
    """The episodes that the words name: "WORLD" (its run 0), "WORLD/RUN" or "failures"; each once, in their order.

    Raises InputError where there is none, and names those nearest to it.
    """
    there, wanted = items(episodes), []
    for word in words:
        wanted += items(episodes[is_failure(episodes)]) if word == "failures" else [_item(word, there)]
    if not wanted:
        raise InputError("failures: no episode of this run failed; name one by its world")
    by_item = episodes.set_index(["world", "run"], drop=False)
    return by_item.loc[list(dict.fromkeys(wanted))].reset_index(drop=True)


def make_pages(
    run_dir: Path,
    episodes: pd.DataFrame,
    places: Mapping[Item, Path],
    executor: Any,
    keep: bool = False,
) -> Iterator[Page]:
    """Write a page for each of the episodes of a run to its place; what became of each, as they finish.

    keep: leave a page of the same episode alone. More than one are made by `executor`, with a progress bar.
    """
    marks = _marks(run_dir, episodes)
    outcomes = dict(zip(items(episodes), episodes["outcome"], strict=True))
    kept = [item for item in places if keep and _bears(places[item], marks[item])]
    yield from (Page(item, places[item], "") for item in kept)
    todo = [item for item in places if item not in kept]
    for path in {places[item].parent for item in todo}:
        _make_folder(path)
    names = dict(zip(items(episodes), episodes["system"], strict=True))
    payload = {"run_dir": run_dir, "places": dict(places), "marks": marks, "systems": names}
    if len(todo) <= 1:
        yield from SerialExecutor(SerialConfig()).map(initialise, payload, todo)
        return
    with EpisodeProgress("Pages", len(todo)) as progress:
        for page in executor.map(initialise, payload, todo):
            progress.add(outcomes[page.item])
            yield page


def initialise(payload: Mapping[str, Any]) -> Callable[[Item], Page]:
    """What makes pages in a process.

    payload: {"run_dir": the run, "places": paths by episode, "marks": what each page is known again by,
    "systems": what tables call them}.
    """
    from runners.explainer.write import write_page
    from runners.workers.trace import rerun_recorded

    run_dir = payload["run_dir"]
    trajectories = cache(lambda: read_trajectories([run_dir]))  # once a process, when the first page asks

    def make(item: Item) -> Page:
        path = payload["places"][item]
        try:
            mark = _MARK.format(payload["marks"][item])
            trace = rerun_recorded(run_dir, *item, trajectories())
            write_page(trace, path, payload["systems"][item], mark)
        except (InputError, OSError) as error:
            return Page(item, path, str(error))
        return Page(item, path, "")

    return make


def index(run_dir: Path) -> Path:
    """Write the index of a run's pages anew; its path."""
    from runners.explainer.index import write_index

    return write_index(read_episodes([run_dir]), run_dir)


def _item(word: str, there: Sequence[Item]) -> Item:
    world_word, _, run_word = word.partition("/")
    if not world_word.isdigit() or not (run_word or "0").isdigit():
        raise InputError(
            f"{word!r} is no episode: give WORLD, WORLD/RUN or failures, such as {_name(there[0])}"
        )
    world, run = int(world_word), int(run_word or 0)
    runs = sorted(number for other, number in there if other == world)
    if not runs:
        worlds = sorted({other for other, _ in there}, key=lambda other: (abs(other - world), other))
        nearest = ", ".join(map(str, sorted(worlds[:_NEAREST])))
        raise InputError(f"world {world} was not driven in this run: those nearest to it are {nearest}")
    if run not in runs:
        raise InputError(f"world {world} has no run {run}: it has {', '.join(map(str, runs))}")
    return world, run


def _name(item: Item) -> str:
    return f"{item[0]}/{item[1]}"


def _marks(run_dir: Path, episodes: pd.DataFrame) -> dict[Item, str]:
    """By episode, what tells it from any other: the run's config and how it ended, as a hash."""
    launch = run_directories.read_launch(run_dir)
    config = launch.fingerprint if launch is not None else ""
    columns = [name for name in ("steps", "path_length_m", "final_distance_m") if name in episodes]
    ends = episodes[["outcome", *columns]].itertuples(index=False)
    return {
        item: hashlib.sha256(json.dumps([config, *item, *end], default=str).encode()).hexdigest()[:16]
        for item, end in zip(items(episodes), ends, strict=True)
    }


def _bears(path: Path, mark: str) -> bool:
    """Whether a page is whole and of the episode with this mark."""
    end = _MARK.format(mark).encode()
    try:
        with path.open("rb") as page:
            page.seek(-len(end), 2)
            return page.read() == end
    except OSError:
        return False


def _make_folder(path: Path) -> None:
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{path}: cannot be made ({error.strerror}): choose another place") from error
