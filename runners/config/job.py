"""One composed and validated run of a command, which the command line hands to everything below it.

Also the weight set that its guide drives with, its scale in words, and options that it names besides the chosen ones.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar, cast

from omegaconf import DictConfig, OmegaConf

from lme.config.composer import resolved
from lme.errors import InputError, nearest
from lme.guides.lme.weight_files import PUBLISHED
from lme.inputs.resources import overlaid
from runners.config import instantiate
from runners.config.catalogue import Catalogue
from runners.config.changes import changed_keys, describe_changes, flatten
from runners.config.escaping import masked_text, masked_values
from runners.config.instantiate import check_parts
from runners.config.schema import SystemConfig
from runners.config.systems import SEVERAL

PARAMETERS = "${parameters:}"  # the parameters of a guide, by the key `weights`
TIMES = "\u00d7"  # escaped, since × looks like the letter x

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

    def check_scale(self) -> None:
        """Raise InputError for factors on the guide's parameters if it has none to multiply."""
        scale = getattr(self.config, "scale", {})
        if scale and "parameters" not in self.config.guide:
            raise InputError(
                f"scale is {dict(scale)}: {self.config.guide['_target_']} has no parameters to multiply; must be {{}}"
            )

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
    """Return the option of every config group, from Hydra's own part of a config; several are joined by +.

    Several ablations at once are known only if the command line chooses them: Hydra does not record them.
    """
    words: Any = OmegaConf.to_container(hydra.overrides.task, resolve=False)  # may interpolate other keys
    lists = [text.partition("=")[2] for text in words if text.startswith("ablation=[")]
    several = {"ablation": SEVERAL.join(map(str.strip, lists[-1].strip("[]").split(",")))} if lists else {}
    choices = hydra.runtime.choices.items()
    return several | {str(group): str(option) for group, option in choices if isinstance(option, str)}


def own_weights(guide: Mapping[str, Any]) -> str | None:
    """Return the weight set of a guide's unresolved config; None if its parameters do not follow a weight set."""
    return guide.get("weight_set", PUBLISHED) if guide.get("parameters") == PARAMETERS else None


def takes_weights(node: Mapping[str, Any]) -> bool:
    """Return whether an unresolved config interpolates the key `weights`."""
    return any(value in (PARAMETERS, "${weights}") for _, value in flatten(node))


def scale_in_words(scale: Mapping[str, float]) -> str:
    """Return a scale as a table shows it, "a_close × 0.5", separated by commas; empty if it changes nothing."""
    return ", ".join(f"{name} {TIMES} {float(factor):.12g}" for name, factor in scale.items() if factor != 1)


def scale_from_words(text: str) -> dict[str, float]:
    """Return the scale of a text from `scale_in_words`."""
    pairs = [part.split(f" {TIMES} ") for part in text.split(", ") if part]
    return {name: float(factor) for name, factor in pairs}


def named_option(
    job: Job[SystemConfig], key: str, group: str, name: str, settings: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Return the node of a group's option `name`, as if the job had chosen it, with `settings` in place of its own.

    For the option that the job has chosen this is the job's own node. key: key of the name in the config, for
    messages. Raises InputError for a name that is not an option.
    """
    if job.choices.get(group) == name:
        return overlaid(getattr(job.config, group), settings or {})
    catalogue = Catalogue(job.folders)
    known = catalogue.options(group)
    if name not in known:
        raise InputError(f"{key} is {name!r}: {nearest(name, known)}must be one of {', '.join(known)}")
    file = f"{group}/{name}"
    node = resolved(group, catalogue.values(file), asdict(job.config), str(catalogue.file(file)))
    return overlaid(node, settings or {})
