"""Compare LME and LME+ with navground's own behaviours in scenarios that navground ships.

    pip install navground
    python navground_table.py [SEEDS]     # 20; seed k is that of Scenario.init_world(world, seed=k)

All agents of a run have the same behaviour.
"""

import sys
import time
from typing import Any, NamedTuple

import numpy as np
import yaml

try:
    from navground import sim
except ModuleNotFoundError as error:
    sys.exit(f"navground_table.py needs {error.name}: pip install navground")
import lme_navground  # noqa: F401 (registers the behaviour)

DT, DURATION, AGENTS, SIGHT = 0.1, 40.0, 6, 5.0  # [s], [s], number, [m]
MARGIN = 0.2  # [m] safety margin of navground's own behaviours; with 0.05 m they collide more
SCENARIOS: dict[str, dict[str, Any]] = {
    "Antipodal": {"radius": 4.0, "position_noise": 0.3, "orientation_noise": 0.5},
    "Cross": {"side": 8.0, "target_margin": 1.0},
    "Corridor": {"length": 12.0, "width": 3.0},
}
LIDAR = {"type": "Lidar", "range": SIGHT, "resolution": 181}
NEIGHBOURS = {
    "type": "Discs",
    "range": SIGHT,
    "number": AGENTS,
    "max_radius": 1.0,
    "max_speed": 2.0,
    "use_nearest_point": False,
}
TRUTH = {"type": "Bounded", "range": SIGHT}  # exact position, velocity and radius of all neighbours
BEHAVIORS: dict[str, tuple[dict[str, Any], list[dict[str, Any]]]] = {
    "LME+, scan and neighbours": ({"type": "LME", "system": "lme_plus"}, [LIDAR, NEIGHBOURS]),
    "LME+, scan alone": ({"type": "LME", "system": "lme_plus"}, [LIDAR]),
    "LME, scan alone": ({"type": "LME", "system": "lme"}, [LIDAR]),
    **{
        name: ({"type": name, "safety_margin": MARGIN}, [TRUTH])
        for name in ("HL", "ORCA", "HRVO", "SocialForce")
    },
}


class Run(NamedTuple):
    """Mean efficacy, as navground defines it, and the shares of agents that collided and that got stuck."""

    efficacy: float
    collided: float
    stuck: float


def world_of(scenario: str, behavior: str, seed: int) -> Any:
    """A world of a scenario, with agents of one behaviour."""
    chosen, sensors = BEHAVIORS[behavior]
    group = {
        "type": "agent",
        "number": AGENTS,
        "radius": 0.25,
        "control_period": DT,
        "kinematics": {"type": "2WDiff", "wheel_axis": 0.5, "max_speed": 1.0},
        "behavior": {**chosen, "optimal_speed": 0.8},
        "state_estimations": sensors,
    }
    made = sim.Scenario.load(yaml.safe_dump({"type": scenario, **SCENARIOS[scenario], "groups": [group]}))
    world = sim.World()
    made.init_world(world, seed=seed)
    return world


def drive(scenario: str, behavior: str, seed: int) -> Run:
    """What happens in one run of `DURATION`."""
    world = world_of(scenario, behavior, seed)
    efficacies, collided = [], set()
    for _ in range(round(DURATION / DT)):
        world.update(DT)
        efficacies += [agent.behavior.efficacy for agent in world.agents if not agent.idle]
        collided |= {world.index_of_agent(agent) for agent in world.get_agents_in_collision(DT)}
        if world.agents_are_idle():
            break
    stuck = world.get_agents_in_deadlock(5.0)
    return Run(float(np.mean(efficacies)), len(collided) / AGENTS, len(stuck) / AGENTS)


def main(seeds: int) -> None:
    print(f"{seeds} seeds, {AGENTS} agents, {DURATION:g} s\n")
    print(
        "| behaviour |",
        " | ".join(f"{name}: efficacy, collided, stuck" for name in SCENARIOS),
        "| wall [s] |",
    )
    print("|---|", "|".join("---:" for _ in SCENARIOS), "|---:|", sep="")
    for behavior in BEHAVIORS:
        began, cells = time.monotonic(), []
        for scenario in SCENARIOS:
            runs = [drive(scenario, behavior, seed) for seed in range(seeds)]
            cells.append(", ".join(f"{mean:.2f}" for mean in np.mean(runs, axis=0)))
        print(f"| {behavior} | {' | '.join(cells)} | {time.monotonic() - began:.0f} |", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 20)
