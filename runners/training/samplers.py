"""Optuna's samplers, which propose the next trial, seeded anew for every trial.

A sampler is made from the seed and the number of the trial. All other state is in the study, so a killed study
resumes with the same proposals.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from lme.errors import InputError, require
from lme.requirements import install
from runners.training.optuna_private import Part

if TYPE_CHECKING:
    from optuna import Study
    from optuna.distributions import BaseDistribution
    from optuna.samplers import BaseSampler
    from optuna.trial import FrozenTrial

    Distributions = dict[str, BaseDistribution]


class Search(Protocol):
    """A search algorithm; `conf/search/` has one file for each."""

    @property
    def batch(self) -> int:
        """Number of trials that are proposed before any of their rewards is known."""

    def sampler(self, seed: int) -> BaseSampler:
        """Return a new sampler."""


@dataclass(slots=True)
class TpeConfig:
    """Keys of TPE. startup: random trials before the model is used. multivariate: one model of all parameters."""

    batch: int
    startup: int
    multivariate: bool

    def __post_init__(self) -> None:
        require("batch", self.batch, at_least=1)
        require("startup", self.startup, at_least=1)


class Tpe:
    """Tree-structured Parzen estimator (Bergstra et al. 2011; multivariate: Falkner et al. 2018)."""

    Config = TpeConfig

    def __init__(self, config: TpeConfig) -> None:
        self._config = config
        self.batch = config.batch

    def sampler(self, seed: int) -> BaseSampler:
        from optuna.samplers import TPESampler

        return TPESampler(
            n_startup_trials=self._config.startup,
            multivariate=self._config.multivariate,
            constant_liar=True,  # running trials count as bad, so a batch does not cluster at one point
            seed=seed,
        )


@dataclass(slots=True)
class GpConfig:
    """Keys of the Gaussian process. startup: number of random trials before the model is used."""

    batch: int
    startup: int

    def __post_init__(self) -> None:
        require("batch", self.batch, at_least=1)
        require("startup", self.startup, at_least=1)


class Gp:
    """Gaussian process, Matérn 5/2 kernel, log expected improvement (paper §III.F; Snoek et al. 2012)."""

    Config = GpConfig

    def __init__(self, config: GpConfig) -> None:
        _require_package("torch", "gp")
        self._config = config
        self.batch = config.batch

    def sampler(self, seed: int) -> BaseSampler:
        import torch
        from optuna.samplers import GPSampler

        # The order of sums, and so the result, must not depend on the number of cores.
        torch.set_num_threads(1)
        return GPSampler(n_startup_trials=self._config.startup, deterministic_objective=False, seed=seed)


@dataclass(slots=True)
class CmaesConfig:
    """Keys of CMA-ES. batch: number of trials at once, and the size of a generation."""

    batch: int

    def __post_init__(self) -> None:
        require("batch", self.batch, at_least=2)


class Cmaes:
    """Covariance matrix adaptation evolution strategy (Hansen 2016); each batch is a generation."""

    Config = CmaesConfig

    def __init__(self, config: CmaesConfig) -> None:
        _require_package("cmaes", "cmaes")
        self.batch = config.batch

    def sampler(self, seed: int) -> BaseSampler:
        from optuna.samplers import CmaEsSampler

        return CmaEsSampler(popsize=self.batch, warn_independent_sampling=False, seed=seed)


@dataclass(slots=True)
class RandomConfig:
    """Keys of the random search. batch: number of trials at once; it does not change the result."""

    batch: int

    def __post_init__(self) -> None:
        require("batch", self.batch, at_least=1)


class Random:
    """Independent random draws."""

    Config = RandomConfig

    def __init__(self, config: RandomConfig) -> None:
        self.batch = config.batch

    def sampler(self, seed: int) -> BaseSampler:
        from optuna.samplers import RandomSampler

        return RandomSampler(seed=seed)


def per_trial(
    make_sampler: Callable[[int], BaseSampler],
    seed: int,
    start_values: Mapping[str, float] | None = None,
    restarts: int = 1,
) -> BaseSampler:
    """Return a sampler that proposes trial n as a new sampler `make_sampler(trial_seed(seed, n))` would.

    start_values: values of trial 0; the search chooses the others. restarts: number of searches, among which the trials
    alternate (`restart_of`); each search knows only its own trials.
    """
    from optuna.samplers import BaseSampler as Base

    class PerTrial(Base):
        _number: int | None = None
        _sampler: BaseSampler

        def _sampler_for(self, trial: FrozenTrial) -> BaseSampler:
            # A trial asks for its parameters one by one: keep its sampler until the next trial.
            number = _origin(trial)
            if number != self._number:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")  # Optuna's warnings that samplers are experimental
                    self._number, self._sampler = number, make_sampler(trial_seed(seed, number))
            return self._sampler

        def _own_study(self, study: Study, trial: FrozenTrial) -> Any:
            """Return the study with only the trials that this trial's search knows."""
            own_restart = restart_of(_origin(trial), restarts)
            return (
                Part(study, lambda other_trial: restart_of(_origin(other_trial), restarts) == own_restart)
                if restarts > 1
                else study
            )

        def infer_relative_search_space(self, study: Study, trial: FrozenTrial) -> Distributions:
            # Without relative parameters Optuna samples each independently, which gives trial 0 its fixed values.
            if start_values and _origin(trial) == 0:
                return {}
            return self._sampler_for(trial).infer_relative_search_space(self._own_study(study, trial), trial)

        def sample_relative(
            self, study: Study, trial: FrozenTrial, search_space: Distributions
        ) -> dict[str, Any]:
            return self._sampler_for(trial).sample_relative(
                self._own_study(study, trial), trial, search_space
            )

        def sample_independent(
            self, study: Study, trial: FrozenTrial, param_name: str, param_distribution: BaseDistribution
        ) -> Any:
            if start_values and param_name in start_values and _origin(trial) == 0:
                return start_values[param_name]
            own_study = self._own_study(study, trial)
            return self._sampler_for(trial).sample_independent(
                own_study, trial, param_name, param_distribution
            )

    return PerTrial()


def _origin(trial: FrozenTrial) -> int:
    """Return the number of the trial or, for a repeat, of the killed process's original trial."""
    # Optuna's RetryHeartbeatStaleTrialCallback sets this attribute.
    return int(trial.system_attrs.get("failed_trial", trial.number))


def restart_of(number: int, restarts: int) -> int:
    """Return the search that trial `number` belongs to."""
    return number % restarts


def trial_seed(seed: int, number: int) -> int:
    """Return a 32-bit seed from the study's seed and the trial's number."""
    return int(np.random.SeedSequence([seed, number]).generate_state(1)[0])


def _require_package(package: str, search: str) -> None:
    if find_spec(package) is None:
        raise InputError(f"search={search} needs {package}: {install(package)}, or choose search=tpe")
