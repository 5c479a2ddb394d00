"""The class of a collision: by hand, and of a real run."""

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.collisions import explained, report
from lme.types import Guidance, Pose, Twist
from lme.worlds.world import World
from runners.cli import main
from tests.builders import observation, stage

DISC = np.array([0.5, 0.0, 0.1])  # its surface is 20 cm before the outline
FAST, SLOW, STILL = Twist(0.5, 0.0), Twist(0.3, 0.0), Twist(0.0, 0.0)


def trace(seen, command, disc=DISC, end=0.2, latency=0.0, twist=STILL):
    """One step at the origin that ends at x = `end` in a disc. seen (M, 2): the points that the robot knew."""
    robot = stage()
    guidance = Guidance(np.array([4.0, 0.0]), points=np.array(seen, dtype=float).reshape(-1, 2))
    here = Pose(0.0, 0.0, 0.0)
    step = SimpleNamespace(
        time=0.0,
        pose=here,
        observation=observation(twist=twist, robot=robot),
        guidance=guidance,
        command=command,
    )
    return SimpleNamespace(
        config=SimpleNamespace(sim={"latency": latency}),
        robot=robot,
        task=SimpleNamespace(world=World(circles=disc[None])),
        steps=(step,),
        end=SimpleNamespace(time=0.2, pose=Pose(end, 0.0, 0.0)),
    )


@pytest.mark.parametrize(
    ("name", "given"),
    [
        # At 0.5 m/s the robot needs 0.1625 m: where there is no more than 0.15 m, the command is at fault.
        ("command", trace([[0.35, 0.0]], FAST, DISC - [0.05, 0.0, 0.0], 0.15, twist=FAST)),
        ("not seen", trace([], FAST)),
        ("not seen", trace([[0.4, 0.2]], SLOW)),
        ("misplaced", trace([[0.4, 0.0]], FAST, DISC - [0.04, 0.0, 0.0], 0.16, twist=FAST)),
        ("moved otherwise", trace([[0.4, 0.0]], SLOW)),
        ("never", trace([[0.22, 0.0]], STILL, twist=FAST)),
    ],
)
def test_the_class_of_a_collision_by_hand(name, given):
    assert explained(given).startswith(f"{name}: ")


def test_what_is_under_way_counts():
    two = trace([[0.28, 0.0]], FAST, latency=0.2)
    two.steps = (two.steps[0], SimpleNamespace(**{**vars(two.steps[0]), "command": STILL, "time": 0.2}))
    assert explained(two).startswith("command: ")


def test_a_planner_that_looks_at_no_obstacle_is_found_at_fault(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = [
        "guide=target",
        "planner=simple",
        "map.worlds=[282]",
        "runs=1",
        "tracking=none",
        "executor=serial",
    ]
    assert main.main(["eval", *words, "hydra.run.dir=bare"]) == 0
    head, line = report(tmp_path / "bare")
    assert head.endswith("1 collisions in 1 episodes")
    assert line.startswith("- world 282, run 0: command: ")
