"""List learned weights, or import a published network."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import IO, TYPE_CHECKING, NamedTuple

from lme.errors import InputError
from lme.inputs.guarded_file import expanded
from runners.cli.help import texts

if TYPE_CHECKING:
    from lme.inputs.onnx_file import Arrays

EXAMPLES = (
    "lme weights",
    "lme weights import dclp network/configback540GMMdense101lambda0-100",
    "lme weights import dclp network/configback540GMMdense101lambda0-100 published_dclp",
    "lme weights import drl_vo drl_vo.zip",
    "lme weights import lics transformer_99.pth",
)


Write = Callable[["Arrays", IO[bytes]], None]


class ForeignNetwork(NamedTuple):
    """A network that its authors published. source: its file. drive: the guide and planner that it belongs to.

    read: returns those weights in the authors' file that this project keeps, and how to write them as an ONNX file.
    Raises InputError.
    """

    source: str
    drive: str
    read: Callable[[Path], tuple[Arrays, Write]]


def _dclp(path: Path) -> tuple[Arrays, Write]:
    from lme.planners.dclp.importing import import_checkpoint
    from lme.planners.dclp.weights import write_weights

    return import_checkpoint(path), write_weights


def _drl_vo(path: Path, batch_norm: str = "sample") -> tuple[Arrays, Write]:
    from lme.planners.drl_vo.importing import import_archive
    from lme.planners.drl_vo.weights import write_weights

    return import_archive(path), partial(write_weights, batch_norm=batch_norm)


def _lics(path: Path) -> tuple[Arrays, Write]:
    from lme.planners.lics import import_state, write_weights

    return import_state(path), write_weights


def _ipaprec(path: Path, sectors: int, unit: float | None = None) -> tuple[Arrays, Write]:
    from lme.planners.ipaprec import import_checkpoint, write_weights

    return import_checkpoint(path, sectors), partial(write_weights, unit=unit)


_DRL_VO = "guide=global_path planner=drl_vo_barn"
NETWORKS = {
    "dclp": ForeignNetwork(
        "the TensorFlow V2 checkpoint of DRL-DCLP", "guide=target planner=dclp_barn", _dclp
    ),
    "drl_vo": ForeignNetwork(
        "the drl_vo.zip of DRL-VO, normalised as it ran for the authors, by the current maps",
        _DRL_VO,
        _drl_vo,
    ),
    "drl_vo_running": ForeignNetwork(
        "the same file, normalised by the statistics of its training",
        _DRL_VO,
        partial(_drl_vo, batch_norm="running"),
    ),
    "lics": ForeignNetwork("the transformer_99.pth of LiCS-KI", "guide=global_planner planner=lics", _lics),
    "maer_nav": ForeignNetwork(
        "a TensorFlow V2 checkpoint of MAER-Nav",
        "guide=target planner=maer_nav",
        partial(_ipaprec, sectors=32),
    ),
    "drl_nsuo": ForeignNetwork(
        "the TensorFlow V2 checkpoint of DRL-NSUO",
        "guide=target planner=drl_nsuo",
        partial(_ipaprec, sectors=30, unit=0.2),
    ),
}


def main(argv: list[str]) -> int:
    """Run `lme weights` or `lme weights import NETWORK PATH [NAME]`. Raises InputError for a wrong file or name."""
    arguments = _parser().parse_args(argv)
    arguments.run(arguments)
    return 0


def _parser() -> argparse.ArgumentParser:
    description = (
        f"{__doc__}\nlme eval takes parameters of LME as weights=NAME, a network as planner.weights=NAME or "
        "guide.weights=NAME."
    )
    parser = argparse.ArgumentParser(prog="lme weights", **texts(description, EXAMPLES))
    parser.set_defaults(run=_list)
    verbs = parser.add_subparsers(metavar="VERB")
    bring = verbs.add_parser("import", help="check and import a network that its authors published")
    sources = "; ".join(f"{name}: {network.source}" for name, network in NETWORKS.items())
    bring.add_argument("network", choices=NETWORKS, help=sources)
    bring.add_argument("path", type=Path, help="the file, or the common prefix of a checkpoint's files")
    bring.add_argument("name", nargs="?", help="for planner.weights=; default: the network's name")
    bring.set_defaults(run=_import)
    return parser


def _list(_: argparse.Namespace) -> None:
    from lme.guides.lme.weight_files import REGISTERED, shipped_networks
    from runners.config import catalogue

    for name in catalogue.shipped().options("weight_set"):
        print(f"{name:<24}  weights={name}, ships with lme")
    for name, path in shipped_networks().items():
        print(f"{name:<24}  {_key(path)}={name}, ships with lme")
    for path in (*sorted(REGISTERED.glob("*.yaml")), *sorted(REGISTERED.glob("*.onnx"))):
        print(f"{path.stem:<24}  {_key(path)}={path.stem}, {path}")


def _key(path: Path) -> str:
    """Return the key that takes a file of parameters, of a guide's network, or of a planner's network."""
    from lme.guides.learned_subgoal.network import SIGNATURE
    from lme.inputs.onnx_file import KIND, OnnxNetwork

    if path.suffix != ".onnx":
        return "weights"
    try:
        of_guide = OnnxNetwork(path).metadata.get(KIND) == SIGNATURE.kind
    except InputError:  # a damaged file is listed, too
        of_guide = False
    return "guide.weights" if of_guide else "planner.weights"


def _import(arguments: argparse.Namespace) -> None:
    from lme.guides.lme.weight_files import REGISTERED, shipped_networks
    from runners.config.quoting import lme_command, override
    from runners.records.atomic_write import replacing
    from runners.records.weight_file import check_name

    # Check the name and the authors' file before anything is written.
    name = arguments.name or arguments.network
    check_name(name, ".onnx", "a network", shipped_networks(), "NAME")
    path = REGISTERED / f"{name}.onnx"
    network = NETWORKS[arguments.network]
    weights, write = network.read(expanded(arguments.path))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as draft, draft.open("wb") as file:
            write(weights, file)
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror or error}") from None
    count = sum(array.size for array in weights.values())
    drive = lme_command("eval", *network.drive.split(), override("planner.weights", name))
    print(f"{path}: {count} weights, all checksums right. Drive: {drive}")
