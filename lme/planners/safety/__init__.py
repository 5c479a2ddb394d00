"""Commands after which a robot can still stop (docs/understand/safety.md): the check, and a filter around any planner."""

from lme.planners.safety.filter import SafetyFilter

__all__ = ["SafetyFilter"]
