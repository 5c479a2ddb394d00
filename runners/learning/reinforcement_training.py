"""Common part of ppo and sac in torch: driving robots, a curriculum, an evaluation every `judge_every` steps."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from statistics import fmean
from time import perf_counter
from typing import TYPE_CHECKING, Any, NamedTuple

import torch
from torch import Tensor, nn

from runners.learning.driving import Driving, Features
from runners.learning.run import Row, Run, descend

if TYPE_CHECKING:
    from runners.learning.learners import ReinforcementConfig

_GRADIENT_MAX = 0.5  # norm of an update's gradient

Losses = Mapping[str, float]


class Parts(NamedTuple):
    """Content of a checkpoint besides the policy: modules and optimisers by name, and the actions' generator."""

    modules: Mapping[str, nn.Module]
    optimisers: Mapping[str, torch.optim.Optimizer]
    generator: torch.Generator

    def descend(self, optimiser: str, loss: Tensor, parameters: Iterable[nn.Parameter]) -> float:
        """Take one optimiser step to reduce a loss; return the loss."""
        return descend(self.optimisers[optimiser], loss, parameters, _GRADIENT_MAX)

    def state(self) -> dict[str, Any]:
        """Return the state of all parts, for a checkpoint."""
        modules = {name: module.state_dict() for name, module in self.modules.items()}
        optimisers = {name: optimiser.state_dict() for name, optimiser in self.optimisers.items()}
        return {**modules, **optimisers, "generator": self.generator.get_state()}

    def load(self, state: Mapping[str, Any]) -> None:
        """Restore the parts from what `state` returned."""
        for name, module in self.modules.items():
            module.load_state_dict(state[name])
        for name, optimiser in self.optimisers.items():
            optimiser.load_state_dict(state[name])
        self.generator.set_state(state["generator"])


class Advanced(NamedTuple):
    """Result of one call of a learner. features: current ones; steps: number driven; losses: by name."""

    features: Features
    steps: int
    losses: Losses


Advance = Callable[[Driving, Features, int], Advanced]


def reinforce(
    run: Run, config: ReinforcementConfig, parts: Parts, names: list[str], advance: Advance
) -> None:
    """Let a learner drive and update, from a checkpoint if there is one, until `config.steps` are done.

    names: names of the losses. advance: takes the robots' features and the number of steps done so far. Episodes in
    progress when a run is killed are not continued.
    """
    # Restore the checkpoint; a new run starts with the validation of the initial network.
    done, stage, episodes = _restore(run, parts)
    driving = Driving(run, config.robots, config.worlds, config.reward, config.curriculum, done)
    if not run.rows:
        _judge(run, parts, 0, driving, dict.fromkeys((*names, "steps_per_s"), math.nan))
    driving.episodes = episodes
    features = driving.start(stage)
    losses: dict[str, list[float]] = defaultdict(list)
    began, judged = perf_counter(), done
    # Advance, move up the curriculum, and validate and save every `judge_every` steps.
    while done < config.steps:
        advanced = advance(driving, features, done)
        features, done = advanced.features, done + advanced.steps
        for name, loss in advanced.losses.items():
            losses[name].append(loss)
        run.describe(f"step {done}, success {driving.success:.2f}")
        if driving.promoted:
            features = driving.start(driving.stage + 1)
        if done - judged >= config.judge_every or done >= config.steps:
            rate = (done - judged) / (perf_counter() - began)
            means = {name: fmean(losses[name]) if losses[name] else math.nan for name in names}
            _judge(run, parts, done, driving, {**means, "steps_per_s": rate})
            losses.clear()
            began, judged = perf_counter(), done


def _judge(run: Run, parts: Parts, done: int, driving: Driving, numbers: Row) -> None:
    """Validate, add a point to the curves, and write the checkpoint."""
    row = {
        "steps": done,
        "episodes": driving.episodes,
        "stage": driving.stage,
        "return": driving.mean_return,
        "driven_success": driving.success,
        **numbers,
        **run.judge(),
    }
    position = {"steps": done, "stage": driving.stage, "episodes": driving.episodes}
    run.save_checkpoint(done, row, {**parts.state(), **position})


def _restore(run: Run, parts: Parts) -> tuple[int, int, int]:
    """Return steps, stage and episodes of the checkpoint, and restore the parts from it."""

    def take(state: dict[str, Any]) -> tuple[int, int, int]:
        parts.load(state)
        return state["steps"], state["stage"], state["episodes"]

    return run.restore(take) or (0, 0, 0)
