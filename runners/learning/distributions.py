"""Distributions from which a policy draws: mixtures of Gaussians over actions, and choices among candidates.

A component of a mixture is a Gaussian with independent v and ω before tanh, so that actions lie in (−1, 1).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor

_HALF_LOG_TAU = 0.5 * math.log(math.tau)


class MixtureBatch(NamedTuple):
    """Mixtures of K Gaussians for B actions before tanh. logits: (B, K); mu, log_sigma: (B, K, 2)."""

    logits: Tensor
    mu: Tensor
    log_sigma: Tensor

    def with_min_sigma(self, sigma: float) -> MixtureBatch:
        """Return the same with no standard deviation below `sigma`, so that a policy keeps exploring."""
        return self._replace(log_sigma=self.log_sigma.clamp(min=math.log(sigma)))

    def draw(self, generator: torch.Generator) -> Tensor:
        """Draw actions before tanh (B, 2), each from a component drawn by its probability. generator: on the CPU."""
        chosen = draw_index(self.logits, generator)[:, None, None]
        index = chosen.expand(-1, 1, self.mu.shape[-1])
        mu, sigma = self.mu.gather(1, index)[:, 0], self.log_sigma.gather(1, index)[:, 0].exp()
        return mu + sigma * _noise(mu, generator)

    def draw_each(self, generator: torch.Generator) -> Tensor:
        """Draw actions before tanh (B, K, 2), one from each component; differentiable in the mixture."""
        return self.mu + self.log_sigma.exp() * _noise(self.mu, generator)

    def log_density(self, raw: Tensor) -> Tensor:
        """Return the logarithm of the density of actions before tanh (B, 2): (B,)."""
        return _log_mixture(self.logits, self.mu, self.log_sigma, raw)

    def actions(self, raw: Tensor) -> Tensor:
        """Return actions (B, 2) in (−1, 1)."""
        return raw.tanh()


def draw_index(logits: Tensor, generator: torch.Generator) -> Tensor:
    """Draw one of the K entries of each row of logits (B, K) by its probability: (B,). generator: on the CPU."""
    odds = logits.softmax(-1).cpu()
    return torch.multinomial(odds, 1, generator=generator)[:, 0].to(logits.device)


def log_density_of_actions(mixture: MixtureBatch, raw: Tensor) -> Tensor:
    """Return the logarithm of the density (B,) of the actions tanh(raw) (B, 2)."""
    # log p(tanh x) = log p(x) − Σ log(1 − tanh² x), with log(1 − tanh² x) in a form that keeps its precision.
    squeeze = 2.0 * (math.log(2.0) - raw - torch.nn.functional.softplus(-2.0 * raw))
    return mixture.log_density(raw) - squeeze.sum(-1)


def log_likelihood(mixture: MixtureBatch, actions: Tensor, least_sigma: float) -> Tensor:
    """Return the logarithm of the density (B,) of an expert's actions (B, 2) in [−1, 1] about the components' means.

    Errors are measured in actions, not before tanh, where an expert's full command is at infinity. least_sigma:
    minimum standard deviation, because the density of a frequent command would otherwise grow without bound.
    """
    log_sigma = mixture.log_sigma.clamp(min=math.log(least_sigma))
    return _log_mixture(mixture.logits, mixture.mu.tanh(), log_sigma, actions)


def _log_mixture(logits: Tensor, means: Tensor, log_sigma: Tensor, values: Tensor) -> Tensor:
    # log Σ_k π_k N(values; means_k, σ_k), with independent coordinates.
    errors = (values[:, None, :] - means) / log_sigma.exp()
    of_component = -(0.5 * errors**2 + log_sigma + _HALF_LOG_TAU).sum(-1)
    return torch.logsumexp(logits.log_softmax(-1) + of_component, -1)


def _noise(like: Tensor, generator: torch.Generator) -> Tensor:
    return torch.randn(like.shape, generator=generator).to(like.device)


class ChoiceBatch(NamedTuple):
    """Distributions of B choices among A candidates. logits: (B, A), −inf for candidates that must not be chosen."""

    logits: Tensor

    def with_min_sigma(self, sigma: float) -> ChoiceBatch:
        """Return the distributions themselves: a choice has no deviation."""
        return self

    def draw(self, generator: torch.Generator) -> Tensor:
        """Draw candidate numbers (B,) by their probability."""
        return draw_index(self.logits, generator)

    def log_density(self, raw: Tensor) -> Tensor:
        """Return the logarithm of the probability of candidates (B,): (B,)."""
        return self.logits.log_softmax(-1).gather(1, raw[:, None])[:, 0]

    def actions(self, raw: Tensor) -> Tensor:
        """Return the numbers themselves."""
        return raw
