"""Print the script for tab completion: eval "$(lme completion bash)"."""

from __future__ import annotations

import argparse

from runners.cli.parsers import texts

EXAMPLES = (
    'eval "$(lme completion bash)"  # in ~/.bashrc to keep it',
    'eval "$(lme completion zsh)"  # in ~/.zshrc',
)


def main(argv: list[str]) -> int:
    """Print a shell's completion script, or the words that may come next, which that script asks for."""
    from runners.cli import completion
    from runners.cli.main import command_files

    arguments = _parser().parse_intermixed_args(argv)
    if arguments.what in completion.SCRIPTS:
        print(completion.SCRIPTS[arguments.what], end="")
        return 0
    candidates = completion.candidates(arguments.line, command_files())
    print("\n".join(completion.drop_broken_part(candidates, arguments.line, arguments.breaks)))
    return 0


def _parser() -> argparse.ArgumentParser:
    title = (__doc__ or "").partition("\n")[0]
    parser = argparse.ArgumentParser(prog="lme completion", **texts(title, EXAMPLES))
    parser.add_argument("what", choices=("bash", "zsh", "words"), help="a shell; words: for its script")
    parser.add_argument("line", nargs="?", default="", help="with words: the line typed so far")
    parser.add_argument("--breaks", default="", help="with words: letters at which the shell breaks words")
    return parser
