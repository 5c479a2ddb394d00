"""Cloning by DAgger (Ross, Gordon and Bagnell 2011): an expert labels what the network and it drive through.

Round 0 is driven by the expert. In later rounds the network drives more and more, so that the expert also tells what
to do where the network's own mistakes lead.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from lme.errors import InputError, require
from runners.config.schema import LearnConfig
from runners.learning.mixture import log_likelihood
from runners.learning.run import Row, Run, descend
from runners.records.whole_file import replacing
from runners.workers.lessons import Lesson, Taught

_DATA = "data"  # folder of what was collected, a file a round
_GRADIENT_MAX = 1.0  # norm of an update's gradient
_SHOWN_EVERY = 20  # updates


@dataclass(slots=True)
class ExpertConfig:
    """Options of planner and guide; the guide counts where the network is told the target, None: it is told the same.

    settings: keys of the planner that have other values than the option's file.
    """

    planner: str = "dwa_tuned"
    guide: str | None = None
    settings: dict[str, Any] = field(default_factory=dict)


@dataclass(slots=True)
class CloneConfig:
    """Keys of `conf/learner/clone.yaml`."""

    rounds: int = 6
    episodes: int = 300  # a round
    updates: list[int] = field(default_factory=lambda: [2000, 6000])  # in the first and in the last round
    batch: int = 256
    lr: float = 1e-3  # of Adam; it falls to a hundredth in every round
    beta: float = 0.5  # in round n the expert drives beta^n of the steps
    least_beta: float = 0.1
    least_sigma: float = 0.03  # no deviation counts as less
    sharpness: float = 10.0  # of the draw of components where the network drives
    mirror: bool = True  # half of every batch is mirrored
    time_limit: float | None = 40.0  # [s] of an episode that is collected
    failures: bool = True  # learn also from episodes that do not succeed
    expert: ExpertConfig = field(default_factory=ExpertConfig)

    def __post_init__(self) -> None:
        for key in ("rounds", "episodes", "batch"):
            require(f"learner.{key}", getattr(self, key), at_least=1)
        for key in ("lr", "least_sigma", "sharpness"):
            require(f"learner.{key}", getattr(self, key), above=0.0)
        for key in ("beta", "least_beta"):
            require(f"learner.{key}", getattr(self, key), at_least=0.0, at_most=1.0)
        if self.time_limit is not None:
            require("learner.time_limit", self.time_limit, above=0.0)
        if len(self.updates) != 2 or min(self.updates) < 1:
            raise InputError(f"learner.updates is {self.updates}: must be [first, last], each at least 1")

    def in_round(self, number: int) -> tuple[int, float]:
        """Updates of a round, counted from 0, and the expert's share of the driving."""
        first, last = self.updates
        updates = round(first + (last - first) * number / max(self.rounds - 1, 1))
        return updates, 1.0 if number == 0 else max(self.beta**number, self.least_beta)


class Data(NamedTuple):
    """N steps. features: one array (N, …) of each input of the network; actions: (N, A) of the expert.

    outcomes: (E, 2) of the E episodes that they were collected in: 1 for a success, and the number of steps.
    """

    features: tuple[Tensor, ...]
    actions: Tensor
    outcomes: Tensor


class Clone:
    """Learns to do what an expert would do, by the likelihood of the expert's actions."""

    Config = CloneConfig

    def __init__(self, config: CloneConfig) -> None:
        self._config = config

    @property
    def total(self) -> int:
        return self._config.rounds

    @property
    def expert(self) -> Mapping[str, Any] | None:
        return asdict(self._config.expert)

    def check(self, config: LearnConfig) -> None:
        """Every simulator will do."""

    def learn(self, run: Run) -> None:
        run.sharpness = self._config.sharpness
        optimiser = torch.optim.Adam(run.network.parameters(), self._config.lr)

        def take(state: dict[str, Any]) -> int:
            optimiser.load_state_dict(state["optimiser"])
            return int(state["rounds"])

        done = run.restore(take) or 0
        parts = [_read(_file(run, number)) for number in range(done)]
        for number in range(done, self._config.rounds):
            new = self._collected(run, number)
            parts = [_joined([*parts, new])]
            loss = self._fit(run, number, parts[0], optimiser)
            row = {**self._row(number, parts[0], new, loss), **run.judged()}
            run.keep(number + 1, row, {"rounds": number + 1, "optimiser": optimiser.state_dict()})

    def _collected(self, run: Run, number: int) -> Data:
        """What a round gives, or gave before the training was killed."""
        path = _file(run, number)
        if not path.is_file():
            config = self._config
            present, (_, beta) = run.write(), config.in_round(number)
            places = run.places(number * config.episodes, config.episodes)
            pairs = zip(places, run.guides(number, config.episodes), strict=True)
            lessons = [Lesson(*place, guide, present, beta, config.time_limit) for place, guide in pairs]
            found = sorted(run.drive(lessons, "collect"), key=lambda taught: taught.lesson.world)
            _write(path, found, config.failures)
        return _read(path)

    def _fit(self, run: Run, number: int, data: Data, optimiser: torch.optim.Optimizer) -> float:
        """Train on all data so far; the mean loss of the last tenth of the updates."""
        config, generator = self._config, run.generator(number)
        updates, _ = config.in_round(number)
        losses = []
        run.network.train()
        for update in range(updates):
            for group in optimiser.param_groups:
                group["lr"] = config.lr * (0.01 + 0.99 * 0.5 * (1.0 + math.cos(math.pi * update / updates)))
            chosen = torch.randint(len(data.actions), (config.batch,), generator=generator)
            losses.append(self._step(run, data, chosen, optimiser))
            if update % _SHOWN_EVERY == 0:
                run.say(f"update {update}/{updates} on {len(data.actions)} steps")
        run.network.eval()
        return float(np.mean(losses[-max(updates // 10, 1) :]))

    def _step(self, run: Run, data: Data, chosen: Tensor, optimiser: torch.optim.Optimizer) -> float:
        features, actions = tuple(each[chosen] for each in data.features), data.actions[chosen]
        if self._config.mirror:
            features, actions = _half_mirrored(run, features, actions)
        loss = -log_likelihood(run.network(*features), actions, self._config.least_sigma).mean()
        return descend(optimiser, loss, run.network.parameters(), _GRADIENT_MAX)

    def _row(self, number: int, data: Data, new: Data, loss: float) -> Row:
        return {
            "round": number + 1,
            "episodes": len(data.outcomes),
            "steps": len(data.actions),
            "beta": self._config.in_round(number)[1],
            "collected_success": new.outcomes[:, 0].mean().item(),
            "loss": loss,
        }


def _half_mirrored(
    run: Run, features: tuple[Tensor, ...], actions: Tensor
) -> tuple[tuple[Tensor, ...], Tensor]:
    half = len(actions) // 2
    mirrored, turned = run.network.mirror(tuple(each[:half] for each in features), actions[:half])
    joined = tuple(torch.cat((new, old[half:])) for new, old in zip(mirrored, features, strict=True))
    return joined, torch.cat((turned, actions[half:]))


def _file(run: Run, number: int) -> Path:
    return run.run_dir / _DATA / f"round_{number:03d}.npz"


def _write(path: Path, found: list[Taught], failures: bool) -> None:
    """Write the steps of the episodes, or of the successful ones alone."""
    kept = [each for each in found if len(each.actions) and (failures or each.outcome == "success")]
    ends = [(each.outcome == "success", len(each.actions)) for each in found]
    if not kept:
        raise InputError(
            f"learner.failures is false, and none of {len(found)} episodes was a success: must be true, "
            "or learner.expert another one"
        )
    parts = zip(*(each.features for each in kept), strict=True)
    path.parent.mkdir(exist_ok=True)
    with replacing(path) as draft:
        arrays = {f"feature_{i}": np.concatenate(part) for i, part in enumerate(parts)}
        arrays |= {
            "actions": np.concatenate([each.actions for each in kept]),
            "outcomes": np.array(ends, np.float32),
        }
        np.savez(draft, **arrays)  # type: ignore[arg-type]  # as in lme.planners.dclp.weights


def _read(path: Path) -> Data:
    """The steps in a file. Raises InputError for a damaged one."""
    try:
        with np.load(path) as file:
            arrays = {name: torch.from_numpy(file[name]) for name in file.files}
        count = sum(name.startswith("feature_") for name in arrays)
        features = tuple(arrays[f"feature_{i}"] for i in range(count))
        return Data(features, arrays["actions"], arrays["outcomes"])
    except Exception as error:  # damaged bytes raise anything
        raise InputError(
            f"{path}: is damaged ({type(error).__name__}): restore it, or start anew in another directory"
        ) from error


def _joined(data: list[Data]) -> Data:
    features = zip(*(each.features for each in data), strict=True)
    return Data(
        tuple(torch.cat(parts) for parts in features),
        torch.cat([each.actions for each in data]),
        torch.cat([each.outcomes for each in data]),
    )
