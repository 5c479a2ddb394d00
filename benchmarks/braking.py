"""Measure how far Jackal slides in sim=gazebo by how hard its wheels are braked (research/table2.md).

    python -m benchmarks.braking

The grip of a wheel pulsates with its angle, and a wheel that is stopped at once may stop where it does not grip.
"""

import math
from collections.abc import Iterator

import numpy as np

from benchmarks.command import run_main
from lme.config.presets import load_robot
from lme.geometry.skid import AXES
from lme.robots import Drivetrain
from lme.simulation.skid.simulator import SlidingBase
from lme.types import Pose, Twist

SPEEDS = (0.5, 1.0, 1.5)  # [m/s] before braking
DECELERATIONS = (1.0, 1.5, 2.0, 3.0, 5.0, 20.0)  # [m/s²] of the command; 20 is the controller's limit
ANGLES = 40  # of the wheels when braking begins
PERIOD = 0.1  # [s] between commands
RUN_UP, SLIDE = 2.0, 6.0  # [s] to reach the speed, and to come to rest


def main() -> None:
    """Print the table."""
    print("\n".join(report()))


def report() -> Iterator[str]:
    """Yield the table in Markdown: median and greatest distance [m]."""
    drivetrain = load_robot("jackal").drivetrain
    assert drivetrain is not None
    yield f"| braking [m/s²] | {' | '.join(f'from {speed:g} m/s' for speed in SPEEDS)} |"
    yield "|---|" + "---:|" * len(SPEEDS)
    for deceleration in DECELERATIONS:
        cells = []
        for speed in SPEEDS:
            distances = [sliding_distance(drivetrain, speed, deceleration, k / ANGLES) for k in range(ANGLES)]
            cells.append(f"{np.median(distances):.2f}, {max(distances):.2f}")
        yield f"| {deceleration:g} | {' | '.join(cells)} |"


def sliding_distance(drivetrain: Drivetrain, speed: float, deceleration: float, turn: float) -> float:
    """Return the distance [m] from the first braking command to rest.

    turn: share of a turn by which the wheels roll on before that command.
    """
    base = SlidingBase(drivetrain, Pose(0.0, 0.0, 0.0), AXES.index("wheel"), lag=0.0)
    _drive(base, speed, RUN_UP + turn * math.tau * drivetrain.wheel_radius / speed)
    begin, command = base.pose, speed
    for _ in range(round(SLIDE / PERIOD)):
        command = max(command - deceleration * PERIOD, 0.0)
        _drive(base, command, PERIOD)
    return math.hypot(base.pose.x - begin.x, base.pose.y - begin.y)


def _drive(base: SlidingBase, speed: float, duration: float) -> None:
    base.drive(Twist(speed, 0.0), duration, 1, (1.0, 1.0), np.zeros(1))


if __name__ == "__main__":
    run_main(main)
