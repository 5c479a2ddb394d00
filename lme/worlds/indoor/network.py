"""Random connected networks: which rooms have a door between them, which junctions a corridor."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def network(rng: np.random.Generator, pairs: Sequence[tuple[int, int]], size: int, loops: float) -> list[int]:
    """Indices of the pairs that join `size` nodes, or as many as the pairs can join.

    A tree grows from a random node by random pairs. Each other pair of two joined nodes is added with probability
    `loops`, which closes a loop.
    """
    joined = {pairs[int(rng.integers(len(pairs)))][0]}
    tree: list[int] = []
    while len(joined) < size:
        onward = [i for i, (a, b) in enumerate(pairs) if (a in joined) != (b in joined)]
        if not onward:
            break
        tree.append(onward[int(rng.integers(len(onward)))])
        joined.update(pairs[tree[-1]])
    others = [i for i, pair in enumerate(pairs) if i not in tree and joined.issuperset(pair)]
    return sorted([*tree, *(i for i in others if rng.random() < loops)])
