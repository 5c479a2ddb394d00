"""Commands after which a robot can still stop: the check, and a filter (docs/understand/safety.md)."""

from lme.planners.safety.filter import SafetyFilter

__all__ = ["SafetyFilter"]
