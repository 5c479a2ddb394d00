"""How far two answers may differ, in one place."""

KERNEL = 1e-9  # a fast function against its slow twin: rounding in float64, nothing else
