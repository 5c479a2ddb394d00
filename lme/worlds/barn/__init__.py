"""The BARN benchmark's worlds (Perille et al. 2020, arXiv:2008.13315)."""

from lme.worlds.barn.map_set import Barn

__all__ = ["Barn"]
