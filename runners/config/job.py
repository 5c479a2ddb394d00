"""One composed and validated run of a command, which the command line hands to everything below it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar, cast

from omegaconf import DictConfig, OmegaConf

from lme.guides.lme.weight_files import PUBLISHED
from runners.config import instantiate
from runners.config.ablations import SEVERAL
from runners.config.catalogue import Catalogue
from runners.config.changes import changed_keys, describe_changes
from runners.config.hydra_errors import check_parts
from runners.config.schema import SystemConfig
from runners.config.urls import masked_text, masked_values
from runners.config.weights import own_weights

C = TypeVar("C", bound=SystemConfig, covariant=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class Job(Generic[C]):
    """One run of a command.

    config: validated. choices: the option of every config group; several are joined by +. overrides: as given for
    this job. changes: keys of the chosen options that have other values than the options' files, by dotted name. Both
    are without passwords.
    folders: config folders, the shipped one first. run_dir: directory that the job writes to. sweep_dir: directory of
    its sweep, if any. own_weights: the weight set of the guide, if it takes one.
    """

    config: C
    choices: Mapping[str, str]
    overrides: tuple[str, ...] = ()
    changes: Mapping[str, Any]
    folders: tuple[Path, ...]
    run_dir: Path = Path()
    sweep_dir: Path | None = None
    own_weights: str | None = None

    @property
    def weights(self) -> str:
        """Weight set that the job drives with: the guide's own if the config names the paper's."""
        named = self.config.weights
        return self.own_weights or named if named == PUBLISHED else named

    @property
    def changes_text(self) -> str:
        """Changes as text: "robot.v_max=1, sim.latency=0.1"; empty if there are none."""
        return describe_changes(self.changes)

    @classmethod
    def composed(cls, config: DictConfig, hydra: Any, catalogue: Catalogue) -> Job[C]:
        """Return the job of a composed config and of Hydra's own part of it.

        Raises what OmegaConf raises, and InputError.
        """
        typed = cast(C, instantiate.typed(config))  # comes first because its errors name the key
        check_parts(typed)
        overrides = tuple(map(masked_text, hydra.overrides.task))
        choices = chosen(hydra)
        return cls(
            config=typed,
            choices=choices,
            overrides=overrides,
            changes={
                key: masked_values(value) for key, value in changed_keys(config, choices, catalogue).items()
            },
            folders=catalogue.folders,
            own_weights=own_weights(cast(dict[str, Any], OmegaConf.to_container(config.guide))),
        )


def chosen(hydra: Any) -> dict[str, str]:
    """Return the option of every config group, from Hydra's own part of a config; several are joined by +."""
    words: Any = OmegaConf.to_container(
        hydra.overrides.task, resolve=False
    )  # one may interpolate what is not there
    return {**_several(words), **_single(hydra.runtime.choices)}


def _single(choices: Mapping[Any, Any]) -> dict[str, str]:
    return {str(group): str(option) for group, option in choices.items() if isinstance(option, str)}


def _several(overrides: Sequence[str]) -> dict[str, str]:
    """Return the choice of several ablations at once, which Hydra does not record; a choice in a file is unknown."""
    lists = [text.partition("=")[2] for text in overrides if text.startswith("ablation=[")]
    return (
        {"ablation": SEVERAL.join(name.strip() for name in lists[-1].strip("[]").split(","))} if lists else {}
    )
