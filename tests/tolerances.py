"""How far two answers may differ, in one place."""

KERNEL = 1e-9  # a fast function against its slow twin: rounding in float64, nothing else
RANGE = 4e-6  # [m] a float32 range of up to 30 m, and where a beam grazes a disc

MIRROR = 1e-3  # [m, rad] after seconds of driving in a mirrored world: scans are float32

FLOAT32_LAYER = 1e-5  # of sums of a hundred products near 1 in float32
NETWORK = 1e-4  # actions of eight such layers
