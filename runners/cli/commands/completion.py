"""Print the script for tab completion: eval "$(lme completion bash)".

The script asks this command for the words that may follow those typed so far. It reads `conf/` as plain YAML, so that a
key press is answered at once.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterable, Sequence
from itertools import pairwise
from pathlib import Path

from lme.errors import InputError
from lme.inputs.guarded_file import expanded
from runners.cli.help import texts
from runners.config import arguments, catalogue
from runners.config.arguments import CFG, INFO

EXAMPLES = (
    'eval "$(lme completion bash)"  # in ~/.bashrc to keep it',
    'eval "$(lme completion zsh)"  # in ~/.zshrc',
)
_PATH_KEYS = (
    "weights",
    "planner.weights",
    "guide.weights",
    "start",
    "resume",
    "run",
    "bag",
    "map.source",
    "hydra.run.dir",
    "hydra.sweep.dir",
)
_CONFIG_DIR = ("--config-dir", "-cd")
_AFTER_FLAG = {"--cfg": CFG, "-c": CFG, "--info": INFO, "-i": INFO}
BASH = """\
_lme() {
    local word IFS=$'\\n'
    COMPREPLY=()
    while read -r word; do COMPREPLY+=("$word"); done < <(
        lme completion words --breaks "$COMP_WORDBREAKS" -- "${COMP_LINE:0:COMP_POINT}" 2>/dev/null)
    if [[ ${#COMPREPLY[@]} -eq 1 && ${COMPREPLY[0]} == *[=./] ]]; then compopt -o nospace; fi
}
complete -o bashdefault -o default -F _lme lme
"""
ZSH = """\
_lme() {
    local -a found
    found=(${(f)"$(lme completion words -- "${(j: :)words[1,CURRENT]}" 2>/dev/null)"})
    compadd -Q -S '' -- ${(M)found:#*[=./]}
    compadd -Q -- ${found:#*[=./]}
}
(( $+functions[compdef] )) || { autoload -Uz compinit && compinit; }
compdef _lme lme
"""
SCRIPTS = {"bash": BASH, "zsh": ZSH}


def main(argv: list[str]) -> int:
    """Print a shell's completion script, or the words that may come next, which that script asks for."""
    from runners.cli.main import command_files

    title = (__doc__ or "").partition("\n")[0]
    parser = argparse.ArgumentParser(prog="lme completion", **texts(title, EXAMPLES))
    parser.add_argument("what", choices=("bash", "zsh", "words"), help="a shell; words: for its script")
    parser.add_argument("line", nargs="?", default="", help="with words: the line typed so far")
    parser.add_argument("--breaks", default="", help="with words: letters at which the shell breaks words")
    parsed = parser.parse_intermixed_args(argv)
    if parsed.what in SCRIPTS:
        print(SCRIPTS[parsed.what], end="")
        return 0
    words = candidates(parsed.line, command_files())
    print("\n".join(drop_broken_part(words, parsed.line, parsed.breaks)))
    return 0


def candidates(line: str, commands: Iterable[str]) -> list[str]:
    """Return the whole words that may replace the last word of `line`."""
    words = line.split(" ")
    *preceding, word = [text for text in words[:-1] if text] + words[-1:]
    if len(preceding) <= 1:
        return _starting(word, (*commands, "--help", "--version"))
    # The value of a flag comes before options of the command.
    folders = [Path(value) for flag, value in pairwise(preceding) if flag in _CONFIG_DIR]
    configs = catalogue.shipped(*folders)
    if preceding[-1] in _CONFIG_DIR:
        return _paths(word, folders_only=True)
    if preceding[-1] in _AFTER_FLAG:
        return _starting(word, _AFTER_FLAG[preceding[-1]])
    # A command with a config takes overrides, any other its own flags and paths.
    try:
        groups = configs.groups(preceding[1])
    except FileNotFoundError:  # a command without a config
        command = Path(__file__).with_name(f"{preceding[1].replace('-', '_')}.py")
        return _starting(word, _flags(command)) if word.startswith("-") else _paths(word)
    if word.startswith("-"):
        return _starting(word, _flags(Path(arguments.__file__)))
    return _override(word, preceding[1], groups, preceding, configs)


def drop_broken_part(texts: Sequence[str], line: str, breaks: str) -> list[str]:
    """Return the candidates without the part that bash takes for an earlier word: it splits words at = and :."""
    word = line.rpartition(" ")[2]
    cut = max((word.rfind(letter) for letter in "=:" if letter in breaks), default=-1) + 1
    return [candidate[cut:] for candidate in texts]


def _override(
    word: str,
    command: str,
    groups: dict[str, str | None],
    preceding: Sequence[str],
    configs: catalogue.Catalogue,
) -> list[str]:
    plus = "+" * (len(word) - len(word.lstrip("+")))
    key, equals, typed_value = word.lstrip("+").partition("=")
    # Complete the key, or the kind of a command that has kinds.
    if not equals:
        names = [*(f"{group}=" for group in groups), *(f"{item.name}=" for item in configs.keys(command))]
        head = key.partition(".")[0]
        if "." in key and head in groups:
            names = [f"{head}.{name}=" for name in _keys(head, groups[head], preceding, configs)]
        if not plus and len(preceding) == len(("lme", command)):
            names = [*configs.options(command), *names]  # lme figure KIND
        return [plus + name for name in _starting(key, names)]
    # Complete the last value of a list or of a sweep.
    last_item = re.split(r"[,\[]", typed_value)[-1]
    finished_items = typed_value.removesuffix(last_item)
    if key in groups:
        values = _starting(last_item, configs.choices(key, command))
    else:
        names = {"weights": configs.options("weight_set"), "resume": ["true", "false"]}.get(key, [])
        values = _starting(last_item, names) + (_paths(last_item) if key in _PATH_KEYS else [])
    return [f"{plus}{key}={finished_items}{value}" for value in values]


def _keys(
    group: str, default: str | None, preceding: Sequence[str], configs: catalogue.Catalogue
) -> list[str]:
    """Return the keys of the option that the line chooses, or of the default option."""
    options = [text.partition("=")[2] for text in preceding if text.lstrip("+").startswith(f"{group}=")]
    if preceding[1] == group and len(preceding) > 2 and preceding[2] in configs.options(group):
        options.insert(0, preceding[2])  # lme figure KIND
    option = options[-1] if options else default
    try:
        return [key.name for key in configs.keys(f"{group}/{option}")]
    except FileNotFoundError:
        return []


def _flags(module: Path) -> list[str]:
    """Return the flags of a module's parser, read from its source because importing a command takes too long."""
    source = module.read_text(encoding="utf-8") if module.is_file() else ""
    return ["--help", *dict.fromkeys(re.findall(r'add_argument\(\s*"(--[\w-]+)"', source))]


def _starting(word: str, names: Iterable[str]) -> list[str]:
    return [name for name in names if name.startswith(word)]


def _paths(word: str, folders_only: bool = False) -> list[str]:
    """Return the files and folders that begin with `word`; folders end in a slash."""
    folder, slash, start = word.rpartition("/")
    try:
        directory = expanded(f"{folder}{slash}" or ".")
        entries = sorted(entry for entry in directory.iterdir() if entry.name.startswith(start))
    except (InputError, OSError):
        return []
    visible = [entry for entry in entries if start.startswith(".") or not entry.name.startswith(".")]
    return [
        f"{folder}{slash}{entry.name}{'/' if entry.is_dir() else ''}"
        for entry in visible
        if entry.is_dir() or not folders_only
    ]
