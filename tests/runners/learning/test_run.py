"""What a training costs, and the picture of its curves."""

import os

import pytest

from runners.workers.imitation_rollouts import ImitationRollout, RolloutResult
from tests.composing import jobs_of

pytest.importorskip("torch")

from runners.learning.run import Run, curves_figure


class Silent:
    def describe(self, doing):
        pass


def test_the_cost_counts_each_worker_once(tmp_path):
    rollout = ImitationRollout("fresh", 100000, "target", "network.onnx", None)
    # Processes and their clocks [s]. The last is this process, in which the serial executor drives.
    clocks = [(-1, 36.0), (-2, 100.0), (-1, 72.0), (os.getpid(), 1e6)]
    results = [RolloutResult(rollout, "success", (), (), clock) for clock in clocks]
    with jobs_of("learn") as job_of:
        config = job_of("guide=learned_subgoal", "learner=ppo").config
    run = Run(config, tmp_path, None, lambda _: results, Silent())
    before = run.cpu_seconds
    assert len(list(run.drive([rollout] * 4, "validate"))) == 4
    assert run.cpu_seconds - before == pytest.approx(172.0, abs=5.0)


def test_curves_are_drawn_by_steps_and_by_time(tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr("runners.learning.run.save", lambda figure, path: drawn.append(figure) or [path])
    shares = [
        {"success": 0.0, "collision": 0.1, "timeout": 0.9},
        {"success": 0.9, "collision": 0.1, "timeout": 0.0},
    ]
    rows = [
        {
            "steps": 100 * i,
            "loss": 1.0,
            "return": 5.0,
            **shares[i],
            "best_success": 0.9,
            "hours": h,
            "cpu_hours": 2 * h,
        }
        for i, h in enumerate((0.05, 0.1))
    ]
    curves_figure(rows, tmp_path / "curves.png")
    by_steps, *lines, by_time = drawn[0].axes
    assert [list(panel.lines[0].get_xdata()) for panel in (by_steps, by_time)] == [[0, 100], [3.0, 6.0]]
    assert [list(panel.lines[0].get_ydata()) for panel in (by_steps, by_time)] == [[0.0, 0.9]] * 2
    assert [panel.get_xlabel() for panel in (by_steps, *lines, by_time)] == [
        "",
        "",
        "steps",
        "minutes; 12.0 of processor time in all",
    ]
