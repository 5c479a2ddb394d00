"""Measures the tracker of people: in DynaBARN, in static BARN worlds, and in real recordings.

    python -m benchmarks.people [--shared ../shared] [--worlds 0-59] [--part dynabarn|static|real|moving …] [--record]
        [--moving ../shared/bags/general_tracking_moving_1.bag]

Scores with CLEAR-MOT within half a metre. The parameters were chosen on DynaBARN worlds from 60 on, on fresh BARN
worlds of seed 0 and on the recordings 1 to 4, so the scores are of the worlds 0 to 59, of fresh worlds of seed 1 and of
the recordings 5 to 7. Nothing was chosen on the recording of --moving, of a robot that drives: it is that of
angusleigh/leg_tracker_benchmarks, which has no licence and is not shipped.
"""

import math
import time
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from benchmarks.command import check_named, run_main
from benchmarks.people.driving import drive
from benchmarks.people.labels import Labels, labels, read
from benchmarks.people.moving import labels_of, read_drive, tracked_in_sector
from benchmarks.people.score import Score
from benchmarks.people.tracked import tracked
from benchmarks.recording import parser, show
from benchmarks.speed import machine
from lme.perception.people.interface import Tracks

NOISE = ("sim.slip=0.05", "sim.scan_noise=0.02")
SCORED = (5, 6, 7)  # of the seven recordings
SHARED = Path("../shared")
MOVING = Path("bags", "general_tracking_moving_1.bag")
_COLUMNS = ("recall", "precision", "mota", "switches", "false", "median", "rms")


def main() -> None:
    """Print the report, and write it with --record."""
    options = parser(__doc__, "people")
    options.add_argument("--shared", type=Path, help=f"folder of the recordings; default: {SHARED}")
    options.add_argument("--worlds", default="0-59", help="of DynaBARN")
    options.add_argument("--part", nargs="*", default=["dynabarn", "static", "real", "moving"])
    options.add_argument(
        "--moving", type=Path, help=f"recording of a robot that drives; default: SHARED/{MOVING}"
    )
    arguments = options.parse_args()
    check_named("--shared", arguments.shared)
    check_named("--moving", arguments.moving)
    shared = arguments.shared or SHARED
    moving = arguments.moving or shared / MOVING
    show(report(shared, arguments.worlds, arguments.part, moving), "people", arguments.record)


def report(shared: Path, worlds: str, sections: list[str], moving: Path) -> Iterator[str]:
    """Yield the lines of the report in Markdown."""
    yield "# People, from the scan alone\n"
    yield f"`python -m benchmarks.people --record`, {time.strftime('%Y-%m-%d')}, {machine()}\n"
    yield "| data | success | recall | precision | MOTA | switches | false a scan | velocity: median | rms | µs |"
    yield "|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|"
    if "dynabarn" in sections:
        for difficulty in ("easy", "medium", "hard"):
            yield _closed_loop_row(f"DynaBARN {difficulty}", worlds, difficulty)
        yield _closed_loop_row("DynaBARN hard, slip 5 %, noise 2 cm", worlds, "hard", *NOISE)
    if "static" in sections:
        fresh_worlds = ("map=barn", "map.subset=fresh", "map.count=60", "map.fresh_seed=1")
        yield _row("static BARN", *_score_episodes(*fresh_worlds))
        yield _row("static BARN, slip 5 %, noise 2 cm", *_score_episodes(*fresh_worlds, *NOISE))
    if "real" in sections:
        yield from _real_scan_rows(shared / "bags" / "legs")
    if "moving" in sections:
        yield _moving(moving)


def _closed_loop_row(name: str, worlds: str, difficulty: str, *words: str) -> str:
    map_words = ("map=dynabarn", f"map.difficulty={difficulty}", f"map.worlds={worlds}")
    return _row(name, *_score_episodes(*map_words, *words))


def _score_episodes(*words: str) -> tuple[Score, str, float]:
    score = Score()
    successes, episodes, times = drive(words, score)
    return score, f"{successes} of {episodes}", float(np.median(times))


def _real_scan_rows(folder: Path) -> Iterator[str]:
    """A row for the recordings together."""
    if not folder.exists():
        yield f"| real: {folder} is absent |"
        return
    score, times = Score(), list[float]()
    for number in SCORED:
        recorded(folder / f"positive_{number}.bag", score, times)
    yield _row(f"real, recordings {', '.join(map(str, SCORED))}", score, "–", float(np.median(times)))


def recorded(path: Path, score: Score, times: list[float]) -> None:
    """Track the people of a recording; add scores, and processor times [µs]."""
    recording = read(path)
    _add(labels(recording), tracked(recording), score, times)


def _moving(path: Path) -> str:
    """The row of a recording of a robot that drives."""
    if not path.exists():
        return f"| moving: {path} is absent |"
    drive, score, times = read_drive(path), Score(), list[float]()
    truth = labels_of(drive)
    _add(truth, tracked_in_sector(drive), score, times)
    return _row(f"real, robot drives, {truth.walking.sum()} labels", score, "–", float(np.median(times)))


def _add(
    truth: Labels, tracks_of_scans: Iterable[tuple[Tracks, float]], score: Score, times: list[float]
) -> None:
    """Add the scores of the tracks of every scan of a recording, and processor times [µs]."""
    score.begin()
    for k, (tracks, spent) in enumerate(tracks_of_scans):
        times.append(spent)
        in_scan = truth.scan == k
        walking = in_scan & truth.walking
        truth_rows = np.hstack([truth.place[walking], truth.velocity[walking]])
        score.add(truth.person[walking], truth_rows, tracks, truth.place[in_scan & ~truth.walking])


def _row(name: str, score: Score, success: str, spent: float) -> str:
    values = score.result()
    cells = [_cell(values[key], 0 if key == "switches" else 3) for key in _COLUMNS]
    return f"| {name} | {success} | {' | '.join(cells)} | {spent:.0f} |"


def _cell(value: float, digits: int) -> str:
    """A number; a dash where nobody is there to be seen."""
    return f"{value:.{digits}f}" if math.isfinite(value) else "–"


if __name__ == "__main__":
    run_main(main)
