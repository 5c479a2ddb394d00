"""What holds for every test."""

from hypothesis import settings

# An example may take as long as it takes: the machine may be busy, and the first call compiles.
settings.register_profile("no deadline", deadline=None)
settings.load_profile("no deadline")
