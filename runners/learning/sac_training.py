"""SAC in torch: the memory of steps, and the updates of policy and critics.

The expectation over the components is exact: each has the weight of its probability, so only Gaussians are sampled.
"""

from __future__ import annotations

import copy
from statistics import fmean
from typing import TYPE_CHECKING, NamedTuple, cast

import torch
from torch import Tensor, nn

from runners.learning.distributions import MixtureBatch, log_density_of_actions
from runners.learning.driving import Driving, Experience, Features
from runners.learning.learnable import Learnable
from runners.learning.reinforcement_training import Advanced, Parts, reinforce
from runners.learning.run import Run

if TYPE_CHECKING:
    from runners.learning.learners import SacConfig

_ACTIONS = 2


class ReplaySteps(NamedTuple):
    """B steps: features, actions before tanh, rewards, ends other than timeouts, and the next features."""

    features: Features
    raw: Tensor
    rewards: Tensor
    terminated: Tensor
    following: Features


class Replay:
    """Memory of the last `capacity` steps, kept on the CPU and sampled uniformly for a network on a device."""

    def __init__(self, capacity: int, device: torch.device) -> None:
        self._capacity, self._device = capacity, device
        self._arrays: list[Tensor] = []
        self.count = 0

    def add(self, step: ReplaySteps) -> None:
        """Add B steps, which replace the oldest ones when the memory is full."""
        flat = [*step.features, step.raw, step.rewards, step.terminated, *step.following]
        if not self._arrays:
            self._arrays = [
                torch.empty((self._capacity, *field.shape[1:]), dtype=field.dtype) for field in flat
            ]
        indices = torch.arange(self.count, self.count + len(step.raw)) % self._capacity
        for array, rows in zip(self._arrays, flat, strict=True):
            array[indices] = rows.cpu()
        self.count += len(step.raw)

    def sample(self, size: int, generator: torch.Generator) -> ReplaySteps:
        """Draw `size` steps, each uniformly from all that are stored."""
        chosen = torch.randint(min(self.count, self._capacity), (size,), generator=generator)
        rows = [array[chosen].to(self._device) for array in self._arrays]
        # The order of the arrays: features, raw, rewards, terminated, following features.
        inputs = (len(rows) - 3) // 2
        raw, rewards, terminated = rows[inputs : inputs + 3]
        return ReplaySteps(tuple(rows[:inputs]), raw, rewards, terminated, tuple(rows[inputs + 3 :]))


class SacTraining:
    """Training of a network from a memory of its own driving."""

    def __init__(self, config: SacConfig) -> None:
        self._config = config

    def learn(self, run: Run) -> None:
        """Continue from the checkpoint of the run until all steps are done."""
        config, policy = self._config, run.network
        critics = nn.ModuleList([policy.critic(_ACTIONS), policy.critic(_ACTIONS)]).to(run.device)
        modules = {"critics": critics, "targets": copy.deepcopy(critics)}
        optimisers = {
            "policy_optimiser": torch.optim.Adam(policy.parameters(), config.lr),
            "critics_optimiser": torch.optim.Adam(critics.parameters(), config.lr),
        }
        parts = Parts(modules, optimisers, run.generator(0))
        replay, updates = Replay(config.replay, run.device), 0

        def advance(driving: Driving, features: Features, done: int) -> Advanced:
            # One step of all robots, then `updates` batches; the policy learns after the critics' first updates.
            nonlocal updates
            features = self._drive(policy, parts, driving, features, replay)
            updates_made: list[dict[str, float]] = []
            if replay.count >= max(config.warm_up, config.batch):
                for _ in range(config.updates):
                    batch = replay.sample(config.batch, parts.generator)
                    updates_made.append(
                        self._update(policy, parts, batch, done > 0 and updates >= config.critics_first)
                    )
                    updates += 1
            names = {name for update_losses in updates_made for name in update_losses}
            losses = {
                name: fmean(update_losses[name] for update_losses in updates_made if name in update_losses)
                for name in names
            }
            return Advanced(features, config.robots, losses)

        reinforce(run, config, parts, ["loss_policy", "loss_value", "entropy"], advance)

    def _drive(
        self, policy: Learnable, parts: Parts, driving: Driving, features: Features, replay: Replay
    ) -> Features:
        """Drive one step and store it; return the features of the next observations."""
        with torch.no_grad():
            raw = self._mixture(policy, features).draw(parts.generator)
        experience = driving.step(raw.tanh())
        replay.add(
            ReplaySteps(features, raw, experience.rewards, experience.terminated, next_features(experience))
        )
        return experience.features

    def _mixture(self, policy: Learnable, features: Features) -> MixtureBatch:
        return cast(MixtureBatch, policy(*features)).with_min_sigma(self._config.least_sigma)

    def _update(
        self, policy: Learnable, parts: Parts, batch: ReplaySteps, learn_policy: bool
    ) -> dict[str, float]:
        """Update critics and their targets, and the policy if it is due; return the losses."""
        targets = self._target_values(policy, parts, batch)
        critics = parts.modules["critics"]
        errors = [
            nn.functional.mse_loss(critic(*batch.features, batch.raw.tanh()), targets)
            for critic in critics.children()
        ]
        losses = {
            "loss_value": parts.descend("critics_optimiser", errors[0] + errors[1], critics.parameters())
        }
        if learn_policy:
            loss, entropy = self._policy_loss(policy, parts, batch)
            losses["loss_policy"] = parts.descend("policy_optimiser", loss, policy.parameters())
            losses["entropy"] = entropy
        # Targets follow the critics: θ' ← θ' + polyak · (θ − θ').
        with torch.no_grad():
            pairs = zip(critics.parameters(), parts.modules["targets"].parameters(), strict=True)
            for new, target in pairs:
                target.lerp_(new, self._config.polyak)
        return losses

    def _target_values(self, policy: Learnable, parts: Parts, batch: ReplaySteps) -> Tensor:
        """Return the critics' target values (B,): r + γ (1 − terminated) (min Q'(s', a') − α log π(a' | s'))."""
        config = self._config
        with torch.no_grad():
            mixture = self._mixture(policy, batch.following)
            raw = mixture.draw(parts.generator)
            worth = lower_value(parts.modules["targets"], batch.following, raw.tanh())
            worth = worth - config.alpha * log_density_of_actions(mixture, raw)
            return batch.rewards + config.gamma * (~batch.terminated).float() * worth

    def _policy_loss(self, policy: Learnable, parts: Parts, batch: ReplaySteps) -> tuple[Tensor, float]:
        """Return the loss over all components, weighted by their probability, and the mean entropy."""
        # loss = E[Σ_k π_k (α log π(a_k) − min Q(s, a_k))], with an action a_k from each component k.
        mixture = self._mixture(policy, batch.features)
        raw = mixture.draw_each(parts.generator)
        density = torch.stack([log_density_of_actions(mixture, actions) for actions in raw.unbind(1)], 1)
        worth = lower_value(parts.modules["critics"], batch.features, raw.tanh())
        odds = mixture.logits.softmax(-1)
        loss = (odds * (self._config.alpha * density - worth)).sum(-1).mean()
        return loss, -(odds * density).sum(-1).mean().item()


def next_features(experience: Experience) -> Features:
    """Return the features after a step: those of the final observation where it ended an episode."""
    seen = tuple(feature.clone() for feature in experience.features)
    for feature, last in zip(seen, experience.last, strict=False):
        feature[experience.ended] = last
    return seen


def lower_value(critics: nn.Module, features: Features, actions: Tensor) -> Tensor:
    """Return the lower of both critics' values. actions: (B, 2), or (B, K, 2) for values (B, K)."""
    first, second = (critic(*features, actions) for critic in critics.children())
    return torch.minimum(first, second)
