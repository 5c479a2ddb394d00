"""Draw a world, watch systems think in it, and take over: a page on this machine; needs `pip install -e '.[play]'`."""

from __future__ import annotations

EXAMPLES = (
    "lme play",
    "lme play system=lme,lme_plus map=barn map.worlds=[282]",
    "lme play robot=jackal_gazebo sim=skid sim.latency=0.1 map=dynabarn",
)


def main(argv: list[str]) -> int:
    """Compose a session and serve its page until Ctrl-C. Raises InputError."""
    from runners.config import arguments

    given = arguments.parse(argv)
    if given.cfg or given.info or given.hydra_help:
        return _print_config(argv)
    from runners.config.schema import PlayConfig
    from runners.play.run import check_installed, serve
    from runners.play.session import Session, Source
    from runners.play.setups import setup_of

    check_installed()
    source = Source(tuple(given.overrides), given.config_name or "play", given.config_dir)
    session = Session(setup_of(source))
    config = session.script.setup.systems[0].config
    assert isinstance(config, PlayConfig)
    serve(session, config.port, config.browser)
    return 0


def _print_config(argv: list[str]) -> int:
    """What --cfg, --info and --hydra-help print."""
    from runners.cli.launch import Command, launch

    return launch(Command("play", lambda job: None, lambda job: None), argv)
