"""A short run of LME to draw decisions of, and its trace."""

import numpy as np
import pytest

from runners.cli.main import main
from runners.reports.figures.driven_runs import DecisionView, read_runs, telling_step

WORDS = ["eval", "map=env2", "robot=stage", "map.worlds=[11]", "runs=1", "executor=serial", "tracking=none"]


@pytest.fixture(scope="session")
def lme_run(tmp_path_factory):
    """The directory of a run of LME: world 11 of env2, cut off after twenty steps."""
    return _driven(tmp_path_factory, "lme")


@pytest.fixture(scope="session")
def plus_run(tmp_path_factory):
    """The same of LME+."""
    return _driven(tmp_path_factory, "lme_plus")


@pytest.fixture(scope="session")
def target_run(tmp_path_factory):
    """The same without a guide."""
    return _driven(tmp_path_factory, "target")


@pytest.fixture(scope="session")
def trace(lme_run):
    (job,) = read_runs([lme_run])
    return job.trace(11, 0)


@pytest.fixture
def shot(trace):
    """The most telling decision."""
    return shot_of(trace, telling_step(trace))


def shot_of(trace, step):
    return DecisionView("LME", trace, step, trace.steps[step].explanation)


def with_criteria(shot, **values):
    """The same decision with further criteria, of weight 1 and with these (N,) values of the candidates."""
    steps = list(shot.trace.steps)
    for step in (shot.step - 1, shot.step):
        steps[step] = steps[step]._replace(explanation=_with(steps[step].explanation, values))
    return shot_of(shot.trace._replace(steps=tuple(steps)), shot.step)


def _with(why, values):
    weights = np.concatenate([why.parameters.weights, np.ones(len(values))])
    return why._replace(
        names=(*why.names, *values),
        features=np.vstack([why.features, *values.values()]),
        old_features=np.concatenate([why.old_features, np.zeros(len(values))]),
        parameters=type(why.parameters)(weights, why.parameters.d1, why.parameters.d2),
    )


def _driven(factory, guide):
    folder = factory.mktemp(guide)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        words = [*WORDS, f"guide={guide}", "map.time_limit=4", f"hydra.run.dir={folder / 'out'}"]
        assert main(words) == 0
    return folder / "out"
