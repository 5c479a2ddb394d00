"""Cloning in torch: the rounds of `Clone`, the data that they collect, and the updates."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
import torch
from torch import Tensor

from lme.errors import InputError
from lme.inputs.guarded_file import check_regular
from runners.learning.distributions import MixtureBatch, log_likelihood
from runners.learning.run import Row, Run, descend
from runners.records.atomic_write import replacing
from runners.workers.imitation_rollouts import ImitationRollout, RolloutResult

if TYPE_CHECKING:
    from runners.learning.learners import CloneConfig

_DATA = "data"  # folder of the collected data, one file per round
_GRADIENT_MAX = 1.0  # norm of an update's gradient
_SHOWN_EVERY = 20  # updates


class Data(NamedTuple):
    """N steps. features: one array (N, …) for each input of the network; actions: the expert's, (N, A).

    outcomes: (E, 2) for the E episodes that were driven: 1 for a success, else 0, and the number of steps.
    """

    features: tuple[Tensor, ...]
    actions: Tensor
    outcomes: Tensor


class CloneTraining:
    """Training of a network to imitate an expert."""

    def __init__(self, config: CloneConfig) -> None:
        self._config = config

    def learn(self, run: Run) -> None:
        """Continue from the checkpoint of the run until all rounds are done."""
        run.sharpness = self._config.sharpness
        optimiser = torch.optim.Adam(run.network.parameters(), self._config.lr)

        def take(state: dict[str, Any]) -> int:
            optimiser.load_state_dict(state["optimiser"])
            return int(state["rounds"])

        # Rounds before the checkpoint are on disk; later ones collect, fit all data so far, validate and save.
        done = run.restore(take) or 0
        parts = [_read(_file(run, number)) for number in range(done)]
        for number in range(done, self._config.rounds):
            collected = self._collect(run, number)
            parts = [_concatenate([*parts, collected])]
            loss = self._fit(run, number, parts[0], optimiser)
            row = {**self._row(number, parts[0], collected, loss), **run.judge()}
            run.save_checkpoint(number + 1, row, {"rounds": number + 1, "optimiser": optimiser.state_dict()})

    def _collect(self, run: Run, number: int) -> Data:
        """Return the data of a round, which a killed training may have collected already."""
        path = _file(run, number)
        if not path.is_file():
            config = self._config
            present, (_, beta) = run.write(), config.in_round(number)
            configurations = run.places(number * config.episodes, config.episodes)
            pairs = zip(configurations, run.guides(number, config.episodes), strict=True)
            rollouts = [
                ImitationRollout(*configuration, guide, present, beta, config.time_limit)
                for configuration, guide in pairs
            ]
            results = sorted(run.drive(rollouts, "collect"), key=lambda result: result.rollout.world)
            _write(path, results, config.failures)
        return _read(path)

    def _fit(self, run: Run, number: int, data: Data, optimiser: torch.optim.Optimizer) -> float:
        """Train on all data so far; return the mean loss of the last tenth of the updates."""
        config, generator = self._config, run.generator(number)
        updates, _ = config.in_round(number)
        losses = []
        run.network.train()
        for update in range(updates):
            # Cosine decay of the learning rate, from lr to lr / 100 over the round.
            for group in optimiser.param_groups:
                group["lr"] = config.lr * (0.01 + 0.99 * 0.5 * (1.0 + math.cos(math.pi * update / updates)))
            chosen = torch.randint(len(data.actions), (config.batch,), generator=generator)
            losses.append(self._step(run, data, chosen, optimiser))
            if update % _SHOWN_EVERY == 0:
                run.describe(f"update {update}/{updates} on {len(data.actions)} steps")
        run.network.eval()
        return float(np.mean(losses[-max(updates // 10, 1) :]))

    def _step(self, run: Run, data: Data, chosen: Tensor, optimiser: torch.optim.Optimizer) -> float:
        features = tuple(feature[chosen].to(run.device) for feature in data.features)
        actions = data.actions[chosen].to(run.device)
        if self._config.mirror:
            features, actions = _half_mirrored(run, features, actions)
        mixture = cast(MixtureBatch, run.network(*features))
        loss = -log_likelihood(mixture, actions, self._config.least_sigma).mean()
        return descend(optimiser, loss, run.network.parameters(), _GRADIENT_MAX)

    def _row(self, number: int, data: Data, collected: Data, loss: float) -> Row:
        return {
            "round": number + 1,
            "episodes": len(data.outcomes),
            "steps": len(data.actions),
            "beta": self._config.in_round(number)[1],
            "collected_success": collected.outcomes[:, 0].mean().item(),
            "loss": loss,
        }


def _half_mirrored(
    run: Run, features: tuple[Tensor, ...], actions: Tensor
) -> tuple[tuple[Tensor, ...], Tensor]:
    half = len(actions) // 2
    mirrored, turned = run.network.mirror(tuple(feature[:half] for feature in features), actions[:half])
    joined = tuple(
        torch.cat((mirrored_half, feature_all[half:]))
        for mirrored_half, feature_all in zip(mirrored, features, strict=True)
    )
    return joined, torch.cat((turned, actions[half:]))


def _file(run: Run, number: int) -> Path:
    return run.run_dir / _DATA / f"round_{number:03d}.npz"


def _write(path: Path, rollouts: list[RolloutResult], failures: bool) -> None:
    """Write the steps of the episodes, or of the successful ones only."""
    used = [
        rollout for rollout in rollouts if len(rollout.actions) and (failures or rollout.outcome == "success")
    ]
    ends = [(rollout.outcome == "success", len(rollout.actions)) for rollout in rollouts]
    if not used:
        raise InputError(
            f"learner.failures is false, but none of {len(rollouts)} episodes was a success: must be true, "
            "or learner.expert must be a better one"
        )
    parts = zip(*(rollout.features for rollout in used), strict=True)
    path.parent.mkdir(exist_ok=True)
    with replacing(path) as draft:
        arrays = {f"feature_{i}": np.concatenate(part) for i, part in enumerate(parts)}
        arrays |= {
            "actions": np.concatenate([rollout.actions for rollout in used]),
            "outcomes": np.array(ends, np.float32),
        }
        np.savez(draft, **arrays)  # type: ignore[arg-type]  # mypy takes names for `allow_pickle`


def _read(path: Path) -> Data:
    """Read the steps in a file. Raises InputError if it is damaged or no file."""
    try:
        check_regular(path)
        with np.load(path) as file:
            arrays = {name: torch.from_numpy(file[name]) for name in file.files}
        count = sum(name.startswith("feature_") for name in arrays)
        features = tuple(arrays[f"feature_{i}"] for i in range(count))
        return Data(features, arrays["actions"], arrays["outcomes"])
    except InputError:
        raise
    except Exception as error:  # damaged bytes can raise anything
        raise InputError(
            f"{path}: is damaged ({type(error).__name__}): restore it, or start again in another directory"
        ) from error


def _concatenate(data: list[Data]) -> Data:
    features = zip(*(batch.features for batch in data), strict=True)
    return Data(
        tuple(torch.cat(parts) for parts in features),
        torch.cat([batch.actions for batch in data]),
        torch.cat([batch.outcomes for batch in data]),
    )
