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
    from runners.play.run import check_installed, serve
    from runners.play.session import Session
    from runners.play.setups import composed

    check_installed()
    made = composed(given.overrides, given.config_dir, given.config_name or "play")
    config = made.jobs[0].config
    serve(Session(made.setup(config.run)), config.port, config.browser)
    return 0


def _print_config(argv: list[str]) -> int:
    """What --cfg, --info and --hydra-help print."""
    from runners.cli.launch import Command, launch

    return launch(Command("play", lambda job: None, lambda job: None), argv)
