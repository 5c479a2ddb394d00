"""Draw a world, watch systems think in it, and take over: a page on this machine; needs `pip install -e '.[play]'`."""

from __future__ import annotations

from typing import TYPE_CHECKING

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
    from runners.config import arguments
    from runners.play.opening import words_of

    episode, words = words_of(argv)
    step, words = _step(words)
    parsed = arguments.parse(words)
    if parsed.cfg or parsed.info or parsed.hydra_help:
        return _print_config(words)
    return _serve(episode, step, parsed)


def _serve(episode: list[str], step: int | None, arguments: Arguments) -> int:
    from lme import numba_cache
    from lme.errors import InputError
    from runners.play.run import check_installed, serve, settings

    check_installed()
    if step is not None and not episode:
        raise InputError(f"{_STEP} {step}: goes with a recorded episode, lme play RUN 282/1 {_STEP} {step}")
    port, browser = settings(arguments)
    if not numba_cache.compiled():
        print(
            "lme play: compiling the kernels once, which takes about a minute; the page opens then",
            flush=True,
        )
    serve(_session(episode, step, arguments), port, browser)
    return 0


def _session(episode: list[str], step: int | None, arguments: Arguments) -> Session:
    """Return the session of a recorded episode, of a drive's log, or of the words alone."""
    from pathlib import Path

    from runners.play.opening import is_log, words_of_log

    if not episode:
        return _composed((), arguments)
    if len(episode) == 1 and step is None and is_log(Path(episode[0])):
        return _composed(words_of_log(Path(episode[0])), arguments)
    return _open_episode(episode, step, arguments)


def _composed(leading_words: tuple[str, ...], arguments: Arguments) -> Session:
    from runners.play.session import Session, Source
    from runners.play.setups import setup_of

    words = (*leading_words, *arguments.overrides)
    return Session(setup_of(Source(words, arguments.config_name or "play", arguments.config_dir)))


def _open_episode(episode: list[str], step: int | None, arguments: Arguments) -> Session:
    from pathlib import Path

    from lme.errors import InputError
    from runners.play.opening import open_episode

    refused = [word for word in arguments.overrides if word.partition("=")[0] not in ("port", "browser")]
    if refused:
        raise InputError(f"{refused[0]}: the episode was driven with its own config; change it on the page")
    if len(episode) > 2:
        raise InputError(f"{episode[2]}: must be lme play RUN WORLD/RUN, one episode")
    return open_episode(Path(episode[0]), episode[1] if len(episode) > 1 else None, step)


def _step(words: list[str]) -> tuple[int | None, list[str]]:
    """Return the number after --step, and the words without the option and its value. Raises InputError."""
    from lme.errors import InputError

    if _STEP not in words:
        return None, words
    index = words.index(_STEP)
    value = words[index + 1] if index + 1 < len(words) else ""
    if not value.isdigit():
        raise InputError(f"{_STEP} {value}: must be the number of a step")
    return int(value), [*words[:index], *words[index + 2 :]]


def _print_config(argv: list[str]) -> int:
    """Print what --cfg, --info and --hydra-help ask for."""
    from runners.cli.launch import Command, launch

    return launch(Command("play", lambda job: None, lambda job: None), argv)
