"""What holds for every test."""

from hypothesis import HealthCheck, settings

# No test fails for being slow: the machine may be busy, and the first call compiles.
settings.register_profile("no deadline", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("no deadline")
