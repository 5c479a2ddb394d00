"""Compares what two versions of the tests find: random mutants of the library, the same in both versions.

    python -m benchmarks.mutants BEFORE AFTER [--number 1000] [--seed 0] [--limit SECONDS]

BEFORE and AFTER are checkouts with the same behaviour. Each mutant changes one operator, constant or condition of a
function of `lme/` that both checkouts have, whatever its variables are called. The tests of the mutant's room run in
AFTER until one fails. Only for a mutant that survives there do they run in BEFORE: it is lost if they find it. A mutant
that AFTER finds counts as found by BEFORE, too, so the difference that is reported is never too good. One line per
mutant goes to outputs/mutants.jsonl, and a run that is started again skips these. The interval is exact (Clopper and
Pearson 1934).
"""

import argparse
import ast
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from scipy.stats import beta

from benchmarks.command import run_main

OUT = Path("outputs") / "mutants.jsonl"
COMPARISONS = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In,
}  # fmt: skip
OPERATIONS = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Mult, ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd,
}  # fmt: skip


class Mutable(NamedTuple):
    """A function of a checkout. shape: its syntax tree without names, by which both checkouts are matched."""

    file: str
    name: str
    shape: str
    tree: ast.AST


def main() -> None:
    """Draw mutants, try each, and print how many the newer tests lose."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("before", type=Path)
    parser.add_argument("after", type=Path)
    parser.add_argument("--number", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--limit", type=float, default=900.0, help="[s] for the tests of a mutant; more: found"
    )
    given = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that the mutated file is put back

    # Match the functions, and draw a place in them: functions with more places are drawn more often.
    before = {(each.name, each.shape): each for each in functions(given.before)}
    both = [(each, before.get((each.name, each.shape))) for each in functions(given.after)]
    places = [
        (new, old, index)
        for new, old in both
        if old is not None
        for index in range(len(list(mutations(new.tree))))
    ]
    random.Random(given.seed).shuffle(places)

    # Try the mutants, those of an earlier run excepted.
    OUT.parent.mkdir(exist_ok=True)
    tried = [json.loads(line) for line in OUT.read_text().splitlines()] if OUT.exists() else []
    known = {(row["file"], row["name"], row["index"]) for row in tried}
    for new, old, index in places[: given.number]:
        if (new.file, new.name, index) in known:
            continue
        killer = killed(given.after, new, index, given.limit)
        lost = None if killer else killed(given.before, old, index, given.limit)
        row = {"file": new.file, "name": new.name, "index": index, "after": killer, "before": lost}
        with OUT.open("a") as log:
            log.write(json.dumps(row) + "\n")
        tried.append(row)
        print(
            f"{len(tried)}: {new.file} {new.name} {index}: {killer or ('lost: ' + lost if lost else 'survives')}",
            flush=True,
        )

    # Report the share that is lost, with its interval of 95 %.
    lost_count, count = sum(row["before"] is not None for row in tried), len(tried)
    found = sum(row["after"] is not None for row in tried)
    highest = beta.ppf(0.975, lost_count + 1, count - lost_count) if lost_count < count else 1.0
    print(
        f"{count} mutants of {len(places)}: {found} found, {lost_count} lost; at most {highest:.1%} are lost (95 %)"
    )


def functions(checkout: Path) -> Iterator[Mutable]:
    """Yield the functions and methods of the library."""
    for path in sorted((checkout / "lme").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.FunctionDef):
                yield Mutable(str(path.relative_to(checkout)), node.name, shape(node), node)


def shape(function: ast.FunctionDef) -> str:
    """Return a function's syntax tree without docstring, annotations and names."""
    copy = ast.parse(ast.unparse(function)).body[0]
    for node in ast.walk(copy):
        for field in ("id", "arg", "attr", "annotation", "returns", "type_comment"):
            if hasattr(node, field):
                setattr(node, field, None)
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            node.value = ""
    assert isinstance(copy, ast.FunctionDef)
    copy.name = ""
    if isinstance(copy.body[0], ast.Expr) and isinstance(copy.body[0].value, ast.Constant):
        copy.body = copy.body[1:]
    return ast.dump(copy)


def mutations(function: ast.AST) -> Iterator[tuple[ast.expr, ast.expr]]:
    """Yield the expressions that can be changed, each with its mutant, in the order of the syntax tree."""
    for node in ast.walk(function):
        if isinstance(node, ast.Compare) and type(node.ops[0]) in COMPARISONS:
            yield (
                node,
                ast.Compare(node.left, [COMPARISONS[type(node.ops[0])](), *node.ops[1:]], node.comparators),
            )
        elif isinstance(node, ast.BinOp) and type(node.op) in OPERATIONS:
            yield node, ast.BinOp(node.left, OPERATIONS[type(node.op)](), node.right)
        elif isinstance(node, ast.BoolOp):
            yield node, ast.BoolOp(ast.Or() if isinstance(node.op, ast.And) else ast.And(), node.values)
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
            yield node, node.operand
        elif (
            isinstance(node, ast.Constant)
            and isinstance(node.value, int | float)
            and not isinstance(node.value, bool)
        ):
            yield node, ast.Constant(node.value + 1)
        elif isinstance(node, ast.IfExp):
            yield node, ast.IfExp(node.test, node.orelse, node.body)


def killed(checkout: Path, function: Mutable, index: int, limit: float) -> str | None:
    """Return the test that finds a mutant, or None. The checkout's file is as before afterwards."""
    path = checkout / function.file
    text = path.read_text()
    node, mutant = list(mutations(function.tree))[index]
    try:
        path.write_text(replaced(text, node, ast.unparse(ast.fix_missing_locations(mutant))))
        return first_failure(checkout, tests_of(checkout, function.file), limit)
    finally:
        path.write_text(text)


def replaced(text: str, node: ast.expr, code: str) -> str:
    """Return a file's text with another expression in the place of a node. Columns count bytes of UTF-8."""
    lines = text.encode().splitlines(keepends=True)
    assert node.end_lineno is not None
    assert node.end_col_offset is not None
    start = sum(map(len, lines[: node.lineno - 1])) + node.col_offset
    end = sum(map(len, lines[: node.end_lineno - 1])) + node.end_col_offset
    whole = text.encode()
    return (whole[:start] + f"({code})".encode() + whole[end:]).decode()


def tests_of(checkout: Path, file: str) -> list[str]:
    """Return the tests that may find a mutant, nearest first: its own file, its room, whole episodes, contracts."""
    module = Path(file)
    stem = module.parent.name if module.stem == "__init__" else module.stem
    near = sorted((checkout / "tests" / module.parent).glob(f"test_{stem}*.py"))
    near += sorted((checkout / "tests" / module.parent.parent).glob(f"test_{module.parent.name}*.py"))
    room = checkout / "tests" / Path(*module.parts[:2])
    more = [room] if room.is_dir() else []
    more += [checkout / "tests" / name for name in ("golden", "contracts")]
    return [str(path.relative_to(checkout)) for path in [*near, *more] if path.exists()]


def first_failure(checkout: Path, tests: list[str], limit: float) -> str | None:
    """Return the first test that fails, "time" beyond the limit, or None if all pass."""
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-x",
        "-q",
        "-p",
        "no:cacheprovider",
        "--hypothesis-seed=0",
        *tests,
    ]
    with tempfile.TemporaryDirectory() as examples:  # none of an earlier mutant's
        environment = {
            **os.environ,
            "PYTHONPATH": str(checkout.resolve()),
            "HYPOTHESIS_STORAGE_DIRECTORY": examples,
        }
        try:
            done = subprocess.run(
                command,
                cwd=checkout,
                env=environment,
                capture_output=True,
                text=True,
                timeout=limit,
                check=False,
            )
        except subprocess.TimeoutExpired:
            return "time"
    if done.returncode == 0:
        return None
    failed = [line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    return failed[0].split(" - ")[0] if failed else f"exit {done.returncode}"


if __name__ == "__main__":
    run_main(main)
