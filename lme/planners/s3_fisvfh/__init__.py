"""S3-FISVFH: a polar histogram searched two steps ahead, with fuzzy velocities."""

from lme.planners.s3_fisvfh.planner import S3Fisvfh

__all__ = ["S3Fisvfh"]
