"""PPO in torch: driving of the robots, and updates of policy and critic."""

from __future__ import annotations

from statistics import fmean
from typing import TYPE_CHECKING, NamedTuple

import torch
from torch import Tensor, nn

from runners.learning.driving import Driving, Features
from runners.learning.learnable import Learnable
from runners.learning.reinforcement_training import Advanced, Parts, reinforce
from runners.learning.run import Run

if TYPE_CHECKING:
    from runners.learning.learners import PpoConfig


class PpoStep(NamedTuple):
    """One or more steps of N robots, with N in front of every shape, or a batch of such steps.

    features; raw: drawn numbers, such as actions before tanh (N, 2); log_density (N,): theirs when they were drawn;
    values (N,): from the critic; rewards (N,); ended (N,): whether the episode ended.
    """

    features: Features
    raw: Tensor
    log_density: Tensor
    values: Tensor
    rewards: Tensor
    ended: Tensor


class Batch(NamedTuple):
    """M steps to learn from, as in `PpoStep`. returns (M,): sum of advantage and value."""

    features: Features
    raw: Tensor
    log_density: Tensor
    advantages: Tensor
    returns: Tensor

    def of(self, chosen: Tensor) -> Batch:
        """Return the chosen steps."""
        return Batch(
            tuple(feature[chosen] for feature in self.features), *(feature[chosen] for feature in self[1:])
        )


class PpoTraining:
    """Training of a network by small changes of the policy that drives."""

    def __init__(self, config: PpoConfig) -> None:
        self._config = config

    def learn(self, run: Run) -> None:
        """Continue from the checkpoint of the run until all steps are done."""
        critic = run.network.critic(0).to(run.device)
        modules = {"critic": critic}
        optimisers = {
            "policy_optimiser": torch.optim.Adam(run.network.parameters(), self._config.lr),
            "critic_optimiser": torch.optim.Adam(critic.parameters(), self._config.lr),
        }
        parts = Parts(modules, optimisers, run.generator(0))

        def advance(driving: Driving, features: Features, done: int) -> Advanced:
            features, batch = self._drive(run.network, parts, driving, features)
            losses = self._update(run.network, parts, batch, learn_policy=done >= self._config.warm_up)
            return Advanced(features, len(batch.raw), losses)

        reinforce(run, self._config, parts, ["loss_policy", "loss_value", "kl"], advance)

    def _drive(
        self, policy: Learnable, parts: Parts, driving: Driving, features: Features
    ) -> tuple[Features, Batch]:
        """Drive `horizon` steps; return the features of the next observations, and the steps."""
        steps = []
        critic = parts.modules["critic"]
        with torch.no_grad():
            for _ in range(self._config.horizon):
                mixture = policy(*features).with_min_sigma(self._config.least_sigma)
                raw, values = mixture.draw(parts.generator), critic(*features)
                experience = driving.step(mixture.actions(raw))
                rewards = experience.rewards
                if len(experience.ended):  # a timeout does not end the task: add γ V(last)
                    ongoing = experience.truncated[experience.ended].float() * critic(*experience.last)
                    rewards[experience.ended] += self._config.gamma * ongoing
                ended = experience.terminated | experience.truncated
                steps.append(PpoStep(features, raw, mixture.log_density(raw), values, rewards, ended))
                features = experience.features
            advantages = advantages_of(steps, critic(*features), self._config.gamma, self._config.decay)
        # Join the steps into one batch, step by step, in which the advantages are in the same order.
        joined = [
            torch.cat([getattr(step, name) for step in steps]) for name in ("raw", "log_density", "values")
        ]
        inputs = tuple(
            torch.cat(features_of_step)
            for features_of_step in zip(*(step.features for step in steps), strict=True)
        )
        raw, density, values = joined
        return features, Batch(inputs, raw, density, advantages, advantages + values)

    def _update(self, policy: Learnable, parts: Parts, batch: Batch, learn_policy: bool) -> dict[str, float]:
        """Train on the steps `epochs` times; return the mean losses. The policy stops if it has changed too much."""
        losses: dict[str, list[float]] = {"loss_policy": [], "loss_value": [], "kl": []}
        for _ in range(self._config.epochs):
            order = torch.randperm(len(batch.raw), generator=parts.generator)
            # Batches in random order; once KL exceeds kl_max, only the critic goes on.
            for chosen in torch.split(order, self._config.batch):
                part = batch.of(chosen)
                if learn_policy:
                    loss, kl = self._policy_loss(policy, part)
                    losses["kl"].append(kl)
                    learn_policy = kl <= self._config.kl_max
                    if learn_policy:
                        losses["loss_policy"].append(
                            parts.descend("policy_optimiser", loss, policy.parameters())
                        )
                critic = parts.modules["critic"]
                loss = nn.functional.mse_loss(critic(*part.features), part.returns)
                losses["loss_value"].append(parts.descend("critic_optimiser", loss, critic.parameters()))
        return {name: fmean(values) for name, values in losses.items() if values}

    def _policy_loss(self, policy: Learnable, part: Batch) -> tuple[Tensor, float]:
        """Return the clipped loss, and the KL divergence from the policy that drove (Schulman's estimate)."""
        # r = π / π_old; loss = −E[min(r A, clip(r, 1 ± ε) A)]; KL ≈ E[r − 1 − log r].
        mixture = policy(*part.features).with_min_sigma(self._config.least_sigma)
        change = mixture.log_density(part.raw) - part.log_density
        ratio = change.exp()
        spread = part.advantages.std() + 1e-6
        advantages = (part.advantages - part.advantages.mean()) / spread
        clipped = ratio.clamp(1.0 - self._config.clip, 1.0 + self._config.clip)
        loss = -torch.minimum(ratio * advantages, clipped * advantages).mean()
        return loss, (ratio - 1.0 - change).mean().item()


def advantages_of(steps: list[PpoStep], values: Tensor, gamma: float, decay: float) -> Tensor:
    """Return generalised advantages (Schulman et al. 2015, arXiv:1506.02438) of T steps of N robots: (T·N,).

    The order is step by step. values: (N,) of the observations after the last step.
    """
    # Backwards: δ_t = r_t + γ V_{t+1} − V_t and A_t = δ_t + γ λ A_{t+1}, without the t+1 terms after an end.
    advantages, advantage = [], torch.zeros_like(values)
    for step in reversed(steps):
        goes_on = (~step.ended).float()
        error = step.rewards + gamma * goes_on * values - step.values
        advantage = error + gamma * decay * goes_on * advantage
        advantages.append(advantage)
        values = step.values
    return torch.cat(advantages[::-1])
