"""The heap, and where it leaves equal keys: paths of equal length depend on it."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from lme.geometry.heap import pop, push


def sunk(heap):
    """The textbook's pop: the last entry sinks from the root, past lesser children."""
    last, k = heap.pop(), 0
    if not heap:
        return heap
    while 2 * k + 1 < len(heap):
        child = min(range(2 * k + 1, min(2 * k + 3, len(heap))), key=lambda c: heap[c][0])
        if last[0] <= heap[child][0]:
            break
        heap[k], k = heap[child], child
    heap[k] = last
    return heap


@given(st.lists(st.one_of(st.none(), st.integers(0, 9)), max_size=120))
def test_entries_lie_as_in_the_textbook(operations):
    """None pops, a number is pushed as a key."""
    keys, items, size, heap = np.empty(120), np.empty(120, np.int32), 0, []
    for item, key in enumerate(operations):
        if key is not None:
            size = push(keys, items, size, float(key), item)
            heap.append((float(key), item))
            k = size - 1
            while k > 0 and heap[k][0] < heap[(k - 1) // 2][0]:
                heap[k], heap[(k - 1) // 2] = heap[(k - 1) // 2], heap[k]
                k = (k - 1) // 2
        elif size > 0:
            assert keys[0] == min(heap)[0]
            size, heap = pop(keys, items, size), sunk(heap)
        assert list(zip(keys[:size].tolist(), items[:size].tolist(), strict=True)) == heap
