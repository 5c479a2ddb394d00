"""Compose jobs for tests as the command line does."""

import functools
from contextlib import contextmanager

from runners.config import command_line
from runners.config.composer import Composer


@contextmanager
def jobs_of(command="eval", *always, config_dir=None):
    """A function from words to the job that `lme COMMAND` makes of them; `always` come before them."""
    with Composer(command, config_dir) as composer:
        yield lambda *words: command_line.compose_job(composer, [*always, *words])


@functools.cache
def composed(command, *words):
    """The whole config of a command line, not resolved. It is composed once, so leave it as it is."""
    with Composer(command) as composer:
        return composer.compose(words)


def last_of_each(*words):
    """The words, but of those that set the same key the last alone: a command line may give a key only once."""
    return list({word.partition("=")[0]: word for word in words}.values())
