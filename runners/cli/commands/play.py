"""Draw a world, watch systems think in it, and take over: a page on this machine; needs `pip install -e '.[play]'`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from lme.errors import InputError

if TYPE_CHECKING:
    from runners.config.arguments import Arguments
    from runners.play.session import Session

EXAMPLES = (
    "lme play",
    "lme play system=lme,lme_plus map=barn map.worlds=[282]",
    "lme play outputs/eval/RUN 282/1",
    "lme play drive.bag robot=turtlebot2",
    "lme play sim=gazebo sim.latency=0.1 map=dynabarn",
)
_STEP = "--step"


def main(argv: list[str]) -> int:
    """Compose a session, or open a recorded episode, and serve its page until Ctrl-C. Raises InputError."""
    from lme import numba_cache
    from runners.config import arguments
    from runners.play.opening import words_of
    from runners.play.run import check_installed, serve, settings

    # Read the command line; print the config if only that was asked for.
    episode, words = words_of(argv)
    step, words = _step(words)
    parsed = arguments.parse(words)
    if parsed.cfg or parsed.info or parsed.hydra_help:
        from runners.cli.launch import Command, launch

        return launch(Command("play", lambda job: None, lambda job: None), words)
    # Make the session and serve it.
    check_installed()
    if step is not None and not episode:
        raise InputError(f"{_STEP} {step}: goes with a recorded episode, lme play RUN 282/1 {_STEP} {step}")
    port, browser = settings(parsed)
    if not numba_cache.compiled():
        print(
            "lme play: compiling the kernels once, which takes about a minute; the page opens then",
            flush=True,
        )
    serve(_session(episode, step, parsed), port, browser)
    return 0


def _session(episode: list[str], step: int | None, arguments: Arguments) -> Session:
    """Return the session of a recorded episode, of a drive's log, or of the words alone."""
    from runners.play.opening import is_log, open_episode, words_of_log
    from runners.play.session import Session, Source
    from runners.play.setups import setup_of

    # A session of one's own, perhaps on the map of a log.
    shows_log = len(episode) == 1 and step is None and is_log(Path(episode[0]))
    if shows_log or not episode:
        words = (*(words_of_log(Path(episode[0])) if shows_log else ()), *arguments.overrides)
        return Session(setup_of(Source(words, arguments.config_name or "play", arguments.config_dir)))
    # A recorded episode.
    refused = [word for word in arguments.overrides if word.partition("=")[0] not in ("port", "browser")]
    if refused:
        raise InputError(f"{refused[0]}: the episode was driven with its own config; change it on the page")
    if len(episode) > 2:
        raise InputError(f"{episode[2]}: must be lme play RUN WORLD/RUN, one episode")
    return open_episode(Path(episode[0]), episode[1] if len(episode) > 1 else None, step)


def _step(words: list[str]) -> tuple[int | None, list[str]]:
    """Return the number after --step, and the words without the option and its value. Raises InputError."""
    if _STEP not in words:
        return None, words
    index = words.index(_STEP)
    value = words[index + 1] if index + 1 < len(words) else ""
    if not value.isdigit():
        raise InputError(f"{_STEP} {value}: must be the number of a step")
    return int(value), [*words[:index], *words[index + 2 :]]
