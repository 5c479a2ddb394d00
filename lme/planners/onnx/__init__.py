"""Policies trained elsewhere, as ONNX files."""

from lme.planners.onnx.planner import OnnxPolicy

__all__ = ["OnnxPolicy"]
