"""S3-FISVFH: two-step search on a polar histogram, with fuzzy velocity control."""

from lme.planners.s3_fisvfh.planner import S3Fisvfh

__all__ = ["S3Fisvfh"]
