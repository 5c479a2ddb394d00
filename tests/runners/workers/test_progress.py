"""What the first drive after installation says of the kernels that it waits for."""

import pytest

from lme import numba_cache
from runners.workers.progress import EpisodeProgress, TrialProgress


@pytest.mark.parametrize("bar", [EpisodeProgress, TrialProgress])
@pytest.mark.parametrize("compiled", [False, True])
def test_a_bar_says_what_it_waits_for(bar, compiled, monkeypatch, capsys):
    monkeypatch.setattr(numba_cache, "compiled", lambda: compiled)
    with bar("LME", 3):
        pass
    assert ("Compiling kernels" in capsys.readouterr().err) == (not compiled)
