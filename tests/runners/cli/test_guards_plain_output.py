"""What is printed cannot steer the terminal."""

import sys

from rich.console import Console

from runners.cli.guards import plain_output


def test_control_codes_of_both_streams_are_shown(capsys):
    with plain_output():
        print("a\x1b]0;own\x07\tb\n\u202ec", end="")
        print("\x9b31m", file=sys.stderr)
    said = capsys.readouterr()
    assert said.out == "a\\x1b]0;own\\x07\tb\n\\u202ec"
    assert said.err == "\\x9b31m\n"


def test_the_streams_are_given_back_and_rich_keeps_its_colours(capsys):
    before = sys.stdout
    with plain_output():
        Console(force_terminal=True).print("[red]x[/red]")
        assert sys.stdout.isatty() == before.isatty()
    assert sys.stdout is before
    assert "\x1b[31mx" in capsys.readouterr().out
