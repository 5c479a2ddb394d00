"""What a bar shows: the kernels that the first drive after installation waits for, and the rungs of a race."""

import pytest

from lme import numba_cache
from runners.workers.progress import EpisodeProgress, RaceProgress, TrialProgress


@pytest.mark.parametrize("bar", [EpisodeProgress, TrialProgress])
@pytest.mark.parametrize("compiled", [False, True])
def test_a_bar_says_what_it_waits_for(bar, compiled, monkeypatch, capsys):
    monkeypatch.setattr(numba_cache, "compiled", lambda: compiled)
    with bar("LME", 3):
        pass
    assert ("Compiling kernels" in capsys.readouterr().err) == (not compiled)


def test_every_rung_of_a_race_is_announced_and_keeps_its_bar(monkeypatch, capsys):
    monkeypatch.setattr(numba_cache, "compiled", lambda: True)
    with RaceProgress() as bar:
        for episodes, candidates in ((2, 1), (3, 40)):
            bar.begin(episodes, candidates)
            for _ in range(episodes):
                bar.add()
            assert f"{episodes} episodes" in capsys.readouterr().err
    shown = capsys.readouterr().err
    assert all(line in shown for line in ("2/2 1 candidate ", "3/3 40 candidates"))
