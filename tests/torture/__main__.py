"""`python -m tests.torture KIND`: what must not break lme. docs/research/reliability.md tells what was tried."""

from __future__ import annotations

import argparse
import sys

from tests.torture import disk, fuzz, kills, machine, observations
from tests.torture.runs import KINDS


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.torture", description=__doc__)
    kinds = parser.add_subparsers(required=True, metavar="KIND")
    readers = kinds.add_parser("readers", help="damaged inputs for every reader")
    readers.add_argument("--inputs", type=int, default=100_000)
    readers.add_argument("--seed", type=int, default=0)
    readers.add_argument("--only", default="", help="readers whose names hold this")
    what = "; ".join(f"{name}: {damaged}" for name, damaged in fuzz.MUTATORS.items())
    readers.add_argument(
        "--mutator", choices=fuzz.MUTATORS, default=fuzz.BYTES, help=f"what is damaged ({what})"
    )
    readers.set_defaults(run=lambda given: fuzz.report(given.inputs, given.seed, given.only, given.mutator))
    for kind, report, times, what in (
        ("kills", kills.report, 100, "SIGKILL at random moments of eval, sweep, train and learn"),
        ("disk", disk.report, 5, "a disk that is full at random moments of the same"),
    ):
        stopped = kinds.add_parser(kind, help=what)
        stopped.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(KINDS)}; default: all")
        stopped.add_argument("--times", type=int, default=times)
        stopped.add_argument("--seed", type=int, default=0)
        stopped.set_defaults(
            run=lambda given, report=report: report(given.names or list(KINDS), given.times, given.seed)
        )
    of_machine = kinds.add_parser("machine", help="clock, read-only folders, two processes, SIGTERM")
    of_machine.set_defaults(run=lambda given: machine.report())
    seen = kinds.add_parser("observations", help="numbers that no robot has, for every system")
    seen.add_argument("names", nargs="*", metavar="SYSTEM", help="default: all of conf/system/")
    seen.add_argument("--drives", type=int, default=200)
    seen.set_defaults(run=lambda given: observations.report(given.names, given.drives))
    given = parser.parse_args()
    return int(given.run(given))


if __name__ == "__main__":
    sys.exit(main())
