"""Words that Hydra and a shell read as they were meant."""

import subprocess
from pathlib import Path

import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser

from runners.config.quoting import element, key_of, lme_command, override, resume_command, unquoted

NAMES = [
    "plain", "with space", "it's", 'a "b"', "a,b", "a=b", "x(1)", "[0]", "{a: 1}", "$HOME", "`id`", "a;b", "50%", "#1",
    "~/x", "1e3", "null", "true", "back\\slash", "täglich", "new\nline", "\x1b[31mred", "tab\t", "é'\x07\\",
]  # fmt: skip


def words_of(command):
    """The words that a shell makes of a line."""
    shown = subprocess.run(["bash", "-c", f"printf '%s\\0' {command}"], capture_output=True, check=True)
    return shown.stdout.decode().split("\0")[:-1]


@pytest.mark.parametrize("name", NAMES)
def test_a_shell_and_hydra_read_what_was_meant(name):
    command = resume_command("eval", Path(name))
    assert command.isprintable()
    first, verb, word = words_of(command)
    assert (first, verb) == ("lme", "eval")
    key, _, value = word.partition("=")
    assert (key, unquoted(value)) == ("resume", name)
    assert OverridesParser.create().parse_override(word).value() == name


def test_a_list_of_names_is_read_as_written():
    word = f"map.paths=[{element('a, b.yaml')},{element('plain.yaml')}]"
    assert OverridesParser.create().parse_override(word).value() == ["a, b.yaml", "plain.yaml"]
    assert override("weights", "published") == "weights=published"


@pytest.mark.parametrize(
    "word", ["planner.margin=1", "+planner.margin=1", "++planner.margin=1", "~planner.margin"]
)
def test_the_key_of_an_override_is_without_its_sign(word):
    assert key_of(word) == "planner.margin"


def test_a_users_own_config_folder_is_named():
    folders = (Path("/shipped"), Path("/my own"))
    assert words_of(lme_command("eval", "map=barn", folders=folders)) == [
        "lme", "eval", "map=barn", "--config-dir", "/my own",
    ]  # fmt: skip
    assert lme_command("eval", folders=folders[:1]) == "lme eval"


def test_a_path_that_begins_with_a_dash_is_no_option():
    assert lme_command("explain", Path("-run"), "failures") == "lme explain ./-run failures"
