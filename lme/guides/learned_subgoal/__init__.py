"""A guide whose subgoals come from a network, and the candidates that the network chooses from."""

from lme.guides.learned_subgoal.guide import LearnedSubgoal

__all__ = ["LearnedSubgoal"]
