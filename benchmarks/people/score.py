"""CLEAR-MOT of tracks against people who are known: recall, precision, MOTA and errors of the velocity."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import motmetrics
import numpy as np

from lme.perception.people.interface import Tracks
from lme.types import Floats, Ints

NEAR = 0.5  # [m] from a person to their track, at most
_CLOCK = 1_000_000  # names of people and tracks of one episode are below


@dataclass(slots=True)
class Score:
    """Collects scans of one or more episodes, which number their people and tracks anew."""

    scans: int = 0
    _episodes: int = 0
    _log: motmetrics.MOTAccumulator = field(default_factory=motmetrics.MOTAccumulator)
    _true: dict[tuple[int, int], Floats] = field(default_factory=dict)
    _tracked_velocities: dict[tuple[int, int], Floats] = field(default_factory=dict)

    def begin(self) -> None:
        """Start an episode."""
        self._episodes += 1

    def add(self, people: Ints, truth: Floats, tracks: Tracks, others: Floats | None = None) -> None:
        """Add a scan: people (P,) and where they are and go, (P, 4); others (O, 2): may be tracked, or not."""
        distances = _apart(truth[:, :2], tracks.pedestrians[:, :2])
        is_counted: Any = np.ones(len(tracks.names), np.bool_)
        if others is not None and len(others) and len(is_counted):
            is_other = (_apart(others, tracks.pedestrians[:, :2]) <= NEAR).any(axis=0)
            is_counted = ~is_other | (distances <= NEAR).any(axis=0)
        offset, scan = self._episodes * _CLOCK, self.scans
        names, distances = tracks.names[is_counted] + offset, distances[:, is_counted]
        pairs = np.where(distances <= NEAR, distances, np.nan)
        self._log.update((people + offset).tolist(), names.tolist(), pairs, frameid=scan)
        self._true |= {(scan, int(name)): v for name, v in zip(people + offset, truth[:, 2:], strict=True)}
        velocities = tracks.pedestrians[is_counted, 2:]
        self._tracked_velocities |= {(scan, int(name)): v for name, v in zip(names, velocities, strict=True)}
        self.scans += 1

    def result(self) -> dict[str, float]:
        """recall, precision, mota; switches; false: tracks a scan; median and rms of the velocity's error [m/s]."""
        metrics = ["recall", "precision", "mota", "num_switches", "num_false_positives"]
        row = motmetrics.metrics.create().compute(self._log, metrics=metrics, name="all").iloc[0]
        events = self._log.mot_events.reset_index()
        pairs = events[events.Type.isin(("MATCH", "SWITCH"))]
        errors = [
            float(np.hypot(*(self._true[scan, int(person)] - self._tracked_velocities[scan, int(track)])))
            for scan, person, track in zip(pairs.FrameId, pairs.OId, pairs.HId, strict=True)
        ] or [np.nan]
        return {
            "recall": float(row.recall),
            "precision": float(row.precision),
            "mota": float(row.mota),
            "switches": float(row.num_switches),
            "false": float(row.num_false_positives) / max(self.scans, 1),
            "median": float(np.median(errors)),
            "rms": float(np.sqrt(np.square(errors).mean())),
        }


def _apart(a: Floats, b: Floats) -> Floats:
    """Distances (A, B) between points (A, 2) and (B, 2) [m]."""
    distances: Floats = np.linalg.norm(a[:, None] - b[None], axis=2)
    return distances
