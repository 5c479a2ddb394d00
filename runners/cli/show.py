"""The output of `--cfg`, `--info` and `--hydra-help`, which replaces running the command."""

from __future__ import annotations

import sys
from typing import Any

import hydra
import yaml
from hydra.core.hydra_config import HydraConfig
from omegaconf import MISSING, DictConfig, ListConfig, OmegaConf
from omegaconf.errors import InterpolationToMissingValueError, OmegaConfBaseException

from lme.errors import InputError
from lme.inputs.resources import resource_dir
from runners.config.arguments import Arguments
from runners.config.composer import without_hydra
from runners.config.escaping import masked_text
from runners.config.instantiate import full_key, translate_error


def config(composed: DictConfig, kind: str, package: str | None, resolve: bool) -> None:
    """Print a composed config as YAML. kind: job, hydra or all. package: the dotted key of the part to print alone.

    Raises InputError for a missing key, or for an interpolation of a missing key.
    """
    HydraConfig.instance().set_config(composed)  # for ${hydra:...}
    OmegaConf.set_readonly(composed.hydra, None)  # set_config sets it; _resolved replaces values
    # Choose between the job's config, Hydra's, and both.
    root = without_hydra(composed) if kind == "job" else composed
    if kind == "hydra":
        hydra_node = (
            _resolved(composed.hydra, composed) if resolve else composed.hydra
        )  # may interpolate other keys
        root = OmegaConf.create({"hydra": hydra_node})
    # Narrow it down to the package.
    node: Any = root
    if package and package != "_global_":
        try:
            node = OmegaConf.select(node, package)
        except OmegaConfBaseException as error:
            raise translate_error(error) from error
        if node is None:
            raise InputError(f"--package {package}: the config has no such key")
        print(f"# @package {package}")
    # Print a single value as text, everything else as YAML, without passwords.
    if not OmegaConf.is_config(node):
        print(masked_text(str(node)))
    elif resolve:
        print(masked_text(yaml.safe_dump(_resolved(node, root), sort_keys=False, allow_unicode=True)), end="")
    else:
        print(masked_text(OmegaConf.to_yaml(node)), end="")


def _resolved(node: DictConfig | ListConfig, root: DictConfig) -> Any:
    """Return a part of `root` as plain values, with ??? for those known only in the run, such as a job's number.

    Raises InputError for an interpolation of a missing key.
    """
    unset: set[str] = set()
    while True:
        try:
            return OmegaConf.to_container(node, resolve=True, enum_to_str=True)
        except OmegaConfBaseException as error:
            key = full_key(error)
            if not isinstance(error, InterpolationToMissingValueError) or key in {"", *unset}:
                raise translate_error(error, OmegaConf.get_type(root)) from error
            unset.add(key)
            OmegaConf.update(root, key, MISSING)


def print_hydra_info(command: str, config_name: str, args: Arguments) -> int:
    """Let Hydra print its own information; return the exit status."""
    original_argv = sys.argv
    flags = ["--hydra-help"] if args.hydra_help else ["--info", str(args.info)]
    flags += ["--config-dir", str(args.config_dir)] if args.config_dir else []
    sys.argv = [f"lme {command}", *flags, *args.overrides]
    try:
        hydra.main(version_base="1.3", config_path=str(resource_dir("conf")), config_name=config_name)(
            print
        )()
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(bool(end.code))
    finally:
        sys.argv = original_argv
    return 0
