"""Runs trials until a study has the requested number."""

from __future__ import annotations

import time
from collections.abc import Callable

from runners.search.study import Proposal, Study
from runners.workers import trials
from runners.workers.executor import Map

_POLL_S = 1.0  # between checks of the trials of other processes


def run_trials(
    study: Study,
    total: int,
    batch: int,
    worlds: list[int],
    run_all: Map,
    note: Callable[[int, float | None], None],
) -> None:
    """Run trials until the study has `total`, starting with the unfinished ones of a killed run.

    If other processes run the last trials, wait for them, and take over those of a process that dies.
    run_all: maps attempts to scores, in any order. note: called with the number of finished trials and the best
    reward so far.
    """
    with study.keep_alive():
        while study.num_told < total:
            if proposals := study.claim(total, batch):
                _run_batch(study, proposals, worlds, run_all)
                for proposal in proposals:
                    study.tell(proposal.number)
                    note(study.num_told, study.best)
            elif study.finds_killed:
                time.sleep(_POLL_S)
                note(study.num_told, study.best)
            else:
                break


def _run_batch(study: Study, batch: list[Proposal], worlds: list[int], run_all: Map) -> None:
    """Run all episodes of a batch. The scores of a trial are stored when its last episode ends."""
    todo = [proposal for proposal in batch if not study.scored(proposal.number)]
    attempts = [
        trials.Attempt(proposal.number, world, tuple(proposal.values.items()))
        for proposal in todo
        for world in worlds
    ]
    scores: dict[int, list[trials.Score]] = {proposal.number: [] for proposal in todo}
    for score in run_all(attempts):
        of_trial = scores[score.trial]
        of_trial.append(score)
        if len(of_trial) == len(worlds):
            study.store_scores(score.trial, sorted(of_trial, key=lambda score: worlds.index(score.world)))
