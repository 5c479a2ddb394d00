"""What a recording by lme says of its episode, damaged: one line, whatever it holds."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from lme.errors import InputError
from runners.recordings.own_recordings import episode_of


@pytest.mark.parametrize("text", ["", "nothing", "[]", "{}", "[" * 900 + "]" * 900, '{"a":' * 100_000])
def test_a_recording_that_does_not_say_its_episode_is_refused(text, says):
    message = SimpleNamespace(content=SimpleNamespace(data=text))
    bag = SimpleNamespace(path=Path("drive.mcap"), by_lme=True, messages=lambda names: iter([message]))
    with says.raises(InputError):
        episode_of(bag)
