"""The distribution over candidates from which a policy draws one."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from runners.learning.mixture import draw_index


class ChoiceBatch(NamedTuple):
    """The distributions of B choices among A candidates. logits: (B, A), −inf for those that may not be chosen."""

    logits: Tensor

    def with_min_sigma(self, sigma: float) -> ChoiceBatch:
        """The same: a choice has no deviation."""
        return self

    def draw(self, generator: torch.Generator) -> Tensor:
        """Numbers (B,) of candidates, drawn by their probability."""
        return draw_index(self.logits, generator)

    def log_density(self, raw: Tensor) -> Tensor:
        """Logarithm of the probability of candidates (B,): (B,)."""
        return self.logits.log_softmax(-1).gather(1, raw[:, None])[:, 0]

    def actions(self, raw: Tensor) -> Tensor:
        """The numbers themselves."""
        return raw
