"""The help of every command, as it is worded."""

import contextlib
import re

import pytest

from runners.cli.main import command_files, main

SUBCOMMANDS = [
    "live ros1",
    "live simulator",
    "maps show",
    "maps import",
    "maps build",
    "maps buildings",
    "weights import",
]


@pytest.mark.parametrize("words", ["", *sorted(command_files()), *SUBCOMMANDS])
def test_help(words, capsys, monkeypatch, says):
    monkeypatch.setenv("COLUMNS", "80")
    with contextlib.suppress(SystemExit):
        assert main([*words.split(), "--help"]) == 0
    text = capsys.readouterr().out
    # The options of a group are described in `conf/`, so a new one changes no wording.
    text = re.sub(r"^(    |  \* )\w+ .*\n( {24}.*\n)*", "", text, flags=re.MULTILINE)
    # As Python 3.13 prints options: --output, -o FILE; their descriptions begin on a line of their own.
    text = re.sub(r"(--[\w-]+) (\S+), (-\w+) \2", r"\1, \3 \2", text)
    says(re.sub(r"^(  -.*?\S) {2,}(?=\S)", r"\1\n" + 24 * " ", text, flags=re.MULTILINE))
