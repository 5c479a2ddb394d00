"""`python -m tests.torture KIND`: what must not break lme. research/reliability.md tells what was tried."""

from __future__ import annotations

import argparse
import sys

from tests.torture import fuzz, observations, stops


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
    for how, times, what in (
        ("kills", 100, "SIGKILL at random moments of eval, sweep, train and learn"),
        ("terms", 5, "SIGTERM to all processes of the same"),
        ("disk", 5, "a disk that is full at random moments of the same"),
    ):
        stopped = kinds.add_parser(how, help=what)
        stopped.add_argument(
            "names", nargs="*", metavar="NAME", help=f"of {', '.join(stops.KINDS)}; default: all"
        )
        stopped.add_argument("--times", type=int, default=times)
        stopped.add_argument("--seed", type=int, default=0)
        stopped.set_defaults(
            run=lambda given, how=how: stops.report(
                how, given.names or list(stops.KINDS), given.times, given.seed
            )
        )
    kinds.add_parser("clock", help="the clock is set back").set_defaults(run=lambda given: stops.clock())
    seen = kinds.add_parser("observations", help="numbers that no robot has, for every system")
    seen.add_argument("names", nargs="*", metavar="SYSTEM", help="default: all of conf/system/")
    seen.add_argument("--drives", type=int, default=200)
    seen.set_defaults(run=lambda given: observations.report(given.names, given.drives))
    given = parser.parse_args()
    return int(given.run(given))


if __name__ == "__main__":
    sys.exit(main())
