"""Black-box search for parameters: samplers, the study and its journal."""

from runners.training.samplers import Cmaes, Gp, Random, Tpe

__all__ = ["Cmaes", "Gp", "Random", "Tpe"]
