"""Distribution over candidates from which a policy draws one."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from runners.learning.mixture import draw_index


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
