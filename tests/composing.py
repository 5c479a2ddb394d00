"""Compose jobs for tests as the command line does."""

from contextlib import contextmanager

from runners.config import command_line
from runners.config.composer import Composer


@contextmanager
def jobs_of(command="eval", *always, config_dir=None):
    """A function from words to the job that `lme COMMAND` makes of them; `always` come before them."""
    with Composer(command, config_dir) as composer:
        yield lambda *words: command_line.compose_job(composer, [*always, *words])


def last_of_each(*words):
    """The words, but of those that set the same key the last alone: a command line may give a key only once."""
    return list({word.partition("=")[0]: word for word in words}.values())
