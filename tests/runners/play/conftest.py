"""Sessions of the words of a command line."""

import pytest

from runners.play.session import Session, Source
from runners.play.setups import setup_of


@pytest.fixture
def session_of():
    """A function from words to a session."""

    def made(*words, run=0, world=None):
        return Session(setup_of(Source(words), run, world))

    return made


def drive(session, until=100_000):
    """Drive to the end, or to a step."""
    session.advance(until, budget_s=600.0)
    return session


def ways(session):
    """What every lane did: a row per frame."""
    return [[frame.row for frame in lane.frames] for lane in session.lanes]
