"""A fully connected layer of a neural network, compiled."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

_UNROLLED = 4  # inputs per pass over a row: each pass reads and writes the row once


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def dense(
    inputs: NDArray[np.float32], kernel: NDArray[np.float32], bias: NDArray[np.float32], slope: float
) -> NDArray[np.float32]:
    """Dense layer: inputs (N, I) @ kernel (I, O) + bias (O,), then leaky ReLU: (N, O). A slope of 1 omits the ReLU.

    The order of the sums does not depend on the number of threads, unlike that of BLAS.
    """
    leak = np.float32(slope)
    depth, width = kernel.shape
    whole = depth - depth % _UNROLLED
    out = np.empty((len(inputs), width), np.float32)
    for n in range(len(inputs)):
        for o in range(width):
            out[n, o] = bias[o]
        # Four rows of the kernel in each pass, then the remaining ones.
        for i in range(0, whole, _UNROLLED):
            a, b, c, d = inputs[n, i], inputs[n, i + 1], inputs[n, i + 2], inputs[n, i + 3]
            for o in range(width):
                more = out[n, o] + a * kernel[i, o] + b * kernel[i + 1, o]
                out[n, o] = more + c * kernel[i + 2, o] + d * kernel[i + 3, o]
        for i in range(whole, depth):
            for o in range(width):
                out[n, o] += inputs[n, i] * kernel[i, o]
        for o in range(width):
            value = out[n, o]
            out[n, o] = value if value > 0.0 else leak * value
    return out
