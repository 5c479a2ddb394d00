"""What MLflow shows of a run besides parameters and metrics: its name, its tags, and its description in Markdown."""

from __future__ import annotations

import getpass
import platform
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from runners.config.quoting import key_of, resume_command
from runners.records.launch_record import NO_RESULTS, commit, read_launch, sweep_launch, versions
from runners.tracking.store import NAME, NOTE

SWEEP = "sweep"
_NAMED = ("guide", "planner", "robot", "map", "ablation", "experiment")  # whose values the name has already
_WORD_LENGTH = 60  # characters of an override in a name
_TABLE_LENGTH = 3500  # characters of a table in a description, of which MLflow keeps 5000


def run_tags(run_dir: Path, tags: Mapping[str, Any], sweep_dir: Path | None = None) -> dict[str, Any]:
    """Return all tags of a run: those given, its name, the commands that start and continue it, code and machine.

    tags: the labels of its records, and `command`.
    """
    launch = read_launch(run_dir)
    sweep = None if sweep_dir is None else sweep_launch(sweep_dir)
    all_tags = {
        **environment_tags(),
        **tags,
        "mlflow.source.name": f"lme {tags.get('command', '')}".rstrip(),
        "mlflow.source.type": "LOCAL",
        "mlflow.user": _user(),
        "run_dir": run_dir.resolve(),
    }
    if launch is not None:
        all_tags["started"] = launch.started
        all_tags["lme.command"] = launch.command_line
        all_tags["lme.resume"] = resume_command(launch.command, run_dir)
    name = run_name(tags, launch.overrides if launch else (), sweep.overrides if sweep else ())
    return {**all_tags, NAME: name or "/".join(run_dir.resolve().parts[-2:]), NOTE: note(all_tags)}


def run_name(tags: Mapping[str, Any], overrides: Sequence[str], of_sweep: Sequence[str] = ()) -> str:
    """Return "LME · barn · jackal · seed=1": the labels, then what else the command line gave; empty without any.

    of_sweep: overrides of its sweep; those that all jobs share are left out of the name of one.
    """
    command = str(tags.get("command", ""))
    words = [word for word in overrides if _key(word).partition(".")[0] not in (*NO_RESULTS, "hydra")]
    if command == SWEEP:
        words = [word for word in overrides if word in words or _key(word) == "system"]
        names = [SWEEP] if words else []
    else:
        labels = [str(tags.get(key, "")) for key in ("system", "map", "robot", "ablation", "bag")]
        names = [label for label in labels if label not in ("", "none")]
        words = [word for word in words if _key(word) not in _NAMED and word not in of_sweep]
    if names and command not in ("", "eval", SWEEP):
        names[0] = f"{command} {names[0]}"
    shown_words = [word if len(word) <= _WORD_LENGTH else f"{word[:_WORD_LENGTH]}…" for word in words]
    return " · ".join([*names, *shown_words]) if names else ""


def _key(word: str) -> str:
    return key_of(word).replace("/", ".")


def note(tags: Mapping[str, Any], artifacts: Sequence[Path] = ()) -> str:
    """Return the description of a run in Markdown: of its artifacts the table, then its commands and its folder."""
    commands = "\n".join(str(tags[key]) for key in ("lme.command", "lme.resume") if key in tags)
    sections = [_table(path) for path in artifacts if path.name == "table.md"]
    sections += [f"```sh\n{commands}\n```"] * bool(commands)
    return "\n\n".join([*sections, f"Folder: `{tags['run_dir']}`"])


def _table(path: Path) -> str:
    """Return the table as far as it fits into a description; a Markdown table may be cut between its lines."""
    text = path.read_text(encoding="utf-8")
    if len(text) <= _TABLE_LENGTH:
        return text.rstrip()
    return (
        f"{text[:_TABLE_LENGTH].rpartition(chr(10))[0]}\n\nThe whole table: {path.name}, among the artifacts."
    )


def environment_tags() -> dict[str, str]:
    """Return tags of what the results may depend on besides the config: commit, versions, platform."""
    checkout = commit()  # None in an installed wheel
    git = (
        {}
        if checkout is None
        else {"mlflow.source.git.commit": checkout.number, "git_changed": str(checkout.changed).lower()}
    )
    return {"platform": platform.platform(), **versions("numpy", "numba"), **git}


def _user() -> str:
    try:
        return getpass.getuser()
    except (KeyError, OSError, ImportError):  # a container's user may have no name
        return "unknown"
