"""The DRL-VO network, run by onnxruntime."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lme.errors import InputError
from lme.inputs.array_file import Arrays
from lme.planners.drl_vo.architecture import LOG_STD
from lme.planners.drl_vo.graph import GOAL_INPUT, IMAGE_INPUT, onnx_model
from lme.requirements import install
from lme.types import Floats

BATCH_NORMS = ("sample", "running")


class DrlVoPolicy:
    """Actor of DRL-VO, run on one core: 4.7 GFLOP at the published size.

    weights: the arrays that `architecture` lists. batch_norm: "sample" uses mean and variance of each feature map
    itself, "running" those of the training. deviations: (2,) of the action's normal distribution.
    Raises InputError if onnx or onnxruntime is not installed.
    """

    def __init__(self, weights: Arrays, batch_norm: str) -> None:
        try:
            import onnxruntime as runtime

            model = onnx_model(weights, batch_norm)
        except ModuleNotFoundError as error:
            advice = install("onnx", "onnxruntime")
            raise InputError(f"the planner drl_vo needs onnx and onnxruntime: {advice}") from error
        options = runtime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1  # the executors fill the cores
        self._session = runtime.InferenceSession(model, options, providers=["CPUExecutionProvider"])
        self.deviations: Floats = np.exp(weights[LOG_STD].astype(np.float64))

    def means(self, image: NDArray[np.float32], goal: Floats) -> Floats:
        """Return the means (2,) of the action. image: (3, 80, 80) of scans, vx and vy; goal: (2,)."""
        given = {IMAGE_INPUT: image[None], GOAL_INPUT: goal.astype(np.float32)[None]}
        (answer,) = self._session.run(None, given)
        means: Floats = answer[0].astype(np.float64)
        return means
