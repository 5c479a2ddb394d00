"""What `--cfg`, `--info` and `--hydra-help` print instead of running a command."""

from __future__ import annotations

import sys

import hydra
import yaml
from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig, OmegaConf

from lme.errors import InputError
from lme.resources import resource_dir
from runners.cli.arguments import Arguments
from runners.config.composer import without_hydra


def config(composed: DictConfig, what: str, package: str | None, resolve: bool) -> None:
    """Print a composed config as YAML. what: job, hydra or all. package: a dotted key, to print that part alone.

    Raises InputError for a key that is not there.
    """
    HydraConfig.instance().set_config(composed)  # for ${hydra:...}
    shown = {
        "job": without_hydra(composed),
        "hydra": OmegaConf.create({"hydra": composed.hydra}),
        "all": composed,
    }
    part = shown[what]
    if package and package != "_global_":
        part = OmegaConf.select(part, package)
        if part is None:
            raise InputError(f"--package {package}: the config has no such key")
        print(f"# @package {package}")
    if not OmegaConf.is_config(part):
        print(part)
    elif resolve:
        plain = OmegaConf.to_container(part, resolve=True, enum_to_str=True)
        print(yaml.safe_dump(plain, sort_keys=False, allow_unicode=True), end="")
    else:
        print(OmegaConf.to_yaml(part), end="")


def hydras_own(command: str, config_name: str, given: Arguments) -> int:
    """Let Hydra print what it knows of itself; returns the exit status."""
    before = sys.argv
    sys.argv = [f"lme {command}", *given.info, *given.config_dir_flag(), *given.overrides]
    try:
        hydra.main(version_base="1.3", config_path=str(resource_dir("conf")), config_name=config_name)(
            print
        )()
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(bool(end.code))
    finally:
        sys.argv = before
    return 0
