"""What Stable-Baselines3 saves for the published network, our reader reads, and our network answers the same."""

from functools import partial

import numpy as np
import pytest

from lme.inputs.onnx_file import TRAINED
from lme.planners.drl_vo.importing import import_archive
from lme.planners.drl_vo.weights import SIGNATURE, Sizes, shapes, write_weights
from tests.networks import signed
from tests.tolerances import DEEP_NETWORK

pytest.importorskip("stable_baselines3", reason="stable-baselines3 is not installed")
from tests.lme.planners.drl_vo import published


@pytest.mark.parametrize(
    "sizes",
    [Sizes(4, 24, 16), pytest.param(Sizes(64, 256, 256), marks=pytest.mark.slow)],
    ids=["a sixteenth", "published"],
)
def test_an_archive_of_stable_baselines_answers_as_it_does_there(tmp_path, sizes):
    ppo = published.untrained(*sizes)
    ppo.save(tmp_path / "drl_vo.zip")
    weights = import_archive(tmp_path / "drl_vo.zip")
    assert {name: array.shape for name, array in weights.items()} == {**shapes(sizes), TRAINED: (2,)}
    rng = np.random.default_rng(0)
    for batch_norm in ("running", "sample"):  # PyTorch changes the running statistics in the second
        write = partial(write_weights, batch_norm=batch_norm)
        network = signed(SIGNATURE, tmp_path / f"{batch_norm}.onnx", write, weights)
        for _ in range(3):
            scans, velocities, goal = (
                rng.normal(size=(80, 80)),
                rng.normal(size=(2, 80, 80)),
                rng.normal(size=2),
            )
            observation = np.concatenate([velocities.ravel(), scans.ravel(), goal])
            image = np.concatenate((scans[None], velocities)).astype(np.float32)
            wanted = published.answer(ppo, observation, batch_norm)
            means, deviations = network.answer(image, goal)
            assert means == pytest.approx(wanted, abs=DEEP_NETWORK)
    assert deviations == pytest.approx(ppo.policy.log_std.detach().exp().numpy())


def test_the_norms_modes_differ(tmp_path):
    ppo = published.untrained(4, 24, 16)
    observation = np.random.default_rng(0).normal(size=published.OBSERVATION)
    assert published.answer(ppo, observation, "running") != pytest.approx(
        published.answer(ppo, observation, "sample"), abs=100 * DEEP_NETWORK
    )
