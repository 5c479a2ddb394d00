"""Runs `lme` and watches from outside how the records of a run and the memory of the command grow."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import time
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

from runners.records.episode_record import APPEND_LOG

LME = str(Path(sys.executable).parent / "lme")
RUN = "run"  # the folder of the run
POLL_S = 0.02


class Sample(NamedTuple):
    """One look. time_s: since the command began. episodes, size: lines and bytes of the append log; None without one.

    rss_mb, peak_mb: memory of the command itself, without its workers, now and at most so far.
    """

    time_s: float
    episodes: int
    size: int | None
    rss_mb: float
    peak_mb: float


class Watched:
    """What was seen of a command. samples: one for every change. wall_s: time of the whole command."""

    def __init__(self, samples: list[Sample], wall_s: float) -> None:
        self.samples = samples
        self.wall_s = wall_s

    @property
    def peak_mb(self) -> float:
        """Peak memory of the command itself."""
        return max(sample.peak_mb for sample in self.samples)

    @property
    def log_bytes(self) -> int:
        """Largest size of the append log."""
        return max(sample.size or 0 for sample in self.samples)

    @cached_property
    def driving(self) -> list[Sample]:
        """From the first new episode to the last. Only for a command that drives."""
        counts = [sample.episodes for sample in self.samples]
        first_count = next(
            (sample.episodes for sample in self.samples if sample.episodes), 0
        )  # of an earlier command
        start = next(index for index, count in enumerate(counts) if count > first_count)
        return self.samples[start : counts.index(max(counts)) + 1]

    @property
    def driving_mb(self) -> float:
        """Peak memory until the last episode."""
        return self.driving[-1].peak_mb

    @property
    def ms_per_episode(self) -> float:
        """Mean time from the end of an episode to the end of the next [ms]."""
        first, *_, last = self.driving
        return (last.time_s - first.time_s) / (last.episodes - first.episodes) * 1e3

    @property
    def start_s(self) -> float:
        """Time until the first new episode."""
        return self.driving[0].time_s

    @property
    def merge_s(self) -> float:
        """Time from the last episode until the log is gone."""
        return self._merged_s - self.driving[-1].time_s

    @property
    def report_s(self) -> float:
        """Time after the merge."""
        return self.wall_s - self._merged_s

    @property
    def _merged_s(self) -> float:
        last = self.driving[-1].time_s
        return next(sample.time_s for sample in self.samples if sample.time_s > last and sample.size is None)


def watch(words: list[str], folder: Path, kill_at: int | None = None) -> Watched:
    """Run `lme` with these words in `folder` until it ends, or kill it when its log holds `kill_at` episodes."""
    start = time.perf_counter()
    log = _Tail(folder / RUN / APPEND_LOG)
    samples: list[Sample] = []
    with (folder / "output.txt").open("w") as output:
        process = subprocess.Popen([LME, *words], cwd=folder, stdout=output, stderr=output)
        while process.poll() is None:
            size = log.look()
            sample = Sample(time.perf_counter() - start, log.lines, size, *_memory(process.pid))
            if not samples or sample[1:] != samples[-1][1:]:
                samples.append(sample)
            if kill_at is not None and log.lines >= kill_at:
                process.kill()
            time.sleep(POLL_S)
    expected_status = 0 if kill_at is None else -signal.SIGKILL
    assert process.returncode == expected_status, (folder / "output.txt").read_text()
    return Watched(samples, time.perf_counter() - start)


class _Tail:
    """Counts the lines of a file that grows."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._read = 0
        self.lines = 0

    def look(self) -> int | None:
        """Count the new lines; the size of the file [B], or None without one."""
        try:
            with self._path.open("rb") as file:
                file.seek(self._read)
                while chunk := file.read(1 << 20):
                    self._read += len(chunk)
                    self.lines += chunk.count(b"\n")
        except FileNotFoundError:
            return None
        return self._read


def _memory(process: int) -> tuple[float, float]:
    """Resident memory of a process now, and its peak so far [MB]; 0 except on Linux, or when it has ended."""
    try:
        status = Path(f"/proc/{process}/status").read_text()
    except OSError:
        return 0.0, 0.0
    kilobytes = dict(re.findall(r"(VmRSS|VmHWM):\s+(\d+) kB", status))
    return int(kilobytes.get("VmRSS", 0)) / 1024, int(kilobytes.get("VmHWM", 0)) / 1024
