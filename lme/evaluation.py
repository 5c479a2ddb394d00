"""`lme eval` as a function. The experiments do the work; they need Hydra, pandas and more, which a robot does not."""

from __future__ import annotations

import importlib
from importlib.util import find_spec
from pathlib import Path
from typing import Any

_EXPERIMENTS = "runners.evaluate.from_python"  # imported at the call, since the library does not need it
_NEEDED = ("runners", "hydra", "matplotlib", "pandas", "pyarrow", "rich")


def evaluate(
    *overrides: str,
    into: str | Path | None = None,
    resume: bool = False,
    workers: int | None = None,
    config_dir: str | Path | None = None,
    progress: bool = True,
    **keys: Any,
) -> Any:
    """Drive a map set with one system, as `lme eval` does, and return the records as a pandas data frame.

    The frame has the columns of `episodes.parquet`, one row per episode, sorted by world and run. Its values are
    those of the command to the last bit, except the measured times: `decision_us_p50`, `decision_us_p99`, `wall_s`.

        frame = lme.evaluate("map.worlds=[200,201]", system="lme_plus", runs=1)

    overrides: as on the command line. keys: the same as keywords; one with a dot is "map.worlds=…", or goes into
    `**{"map.worlds": [200, 201]}`. into: the run's directory, for everything that the command writes; None:
    nothing is written. resume: continue the run in `into`, if it holds one: only what is missing is driven. workers:
    number of processes; None: one per core. config_dir: a folder with your own options. progress: show a bar.
    MLflow tracks nothing unless `tracking="mlflow"` asks for it, with `into`.

    Raises InputError for a mistake in the config, and ImportError if only the library is installed.
    """
    missing = [name for name in _NEEDED if find_spec(name) is None]
    if missing:
        raise ImportError(
            f"lme.evaluate needs more than the library ({', '.join(missing)}): "
            "run pip install --editable . in a checkout of lme"
        )
    return importlib.import_module(_EXPERIMENTS).evaluate(
        overrides,
        keys,
        into=into,
        resume=resume,
        workers=workers,
        config_dir=config_dir,
        progress=progress,
    )
