"""Runs trials until a study has the requested number."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from runners.search.study import Proposal, Study
from runners.workers.executor import Map
from runners.workers.trials import Attempt, Place, Score

_POLL_S = 1.0  # between checks of the trials of other processes


def run_trials(
    study: Study,
    total: int,
    batch: int,
    places: Sequence[Place],
    run_all: Map,
    note: Callable[[int, float | None], None],
) -> None:
    """Run trials until the study has `total`, starting with the unfinished ones of a killed run.

    If other processes run the last trials, wait for them, and take over those of a process that dies.
    places: what every trial drives. run_all: maps attempts to scores, in any order. note: called with the number of
    finished trials and the best reward so far.
    """
    with study.keep_alive():
        while study.num_told < total:
            if proposals := study.claim(total, batch):
                _run_batch(study, proposals, places, run_all)
                for proposal in proposals:
                    study.tell(proposal.number)
                    note(study.num_told, study.best)
            elif study.finds_killed:
                time.sleep(_POLL_S)
                note(study.num_told, study.best)
            else:
                break


def _run_batch(study: Study, batch: list[Proposal], places: Sequence[Place], run_all: Map) -> None:
    """Run all episodes of a batch. The scores of a trial are stored when its last episode ends."""
    todo = [proposal for proposal in batch if not study.scored(proposal.number)]
    attempts = [
        Attempt(proposal.number, *place, tuple(proposal.values.items()))
        for proposal in todo
        for place in places
    ]
    scores: dict[int, dict[Place, Score]] = {proposal.number: {} for proposal in todo}
    for score in run_all(attempts):
        of_trial = scores[score.trial]
        of_trial[score.place] = score
        if len(of_trial) == len(places):
            study.store_scores(score.trial, [of_trial[place] for place in places])
