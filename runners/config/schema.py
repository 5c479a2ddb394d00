"""Schema of every command's config, and the resolvers of its interpolations."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, fields
from enum import StrEnum, auto
from typing import Any

from hydra.core.config_store import ConfigStore
from omegaconf import OmegaConf

from lme.config.composer import register_resolvers
from lme.errors import argument_error, require
from lme.perception.people.source import People
from lme.robots import Cap, Robot
from lme.types import Feedback

PUBLISHED_MARK = " (published)"  # end of the name of a row with published figures


class Record(StrEnum):
    """Output of an episode besides its record. Hydra knows the members by name, hence the lower case."""

    none = auto()
    mcap = auto()


class Explain(StrEnum):
    """Episodes that get an explainer page."""

    none = auto()
    failures = auto()
    all = auto()


@dataclass(slots=True)
class SystemNames:
    """Names of the system in tables and pictures. label: None for the pair's own; ablated: that of the ablation."""

    label: str | None = None
    ablated: str = ""

    def __post_init__(self) -> None:
        """Raise InputError for a name that cannot be read, or that passes for a published row."""
        label = self.label
        if label is None:
            return
        if not label.strip() or not label.isprintable():
            raise argument_error(f"label is {label!r}: must be a name of one line")
        if label.endswith(PUBLISHED_MARK):
            raise argument_error(
                f"label is {label}: must not end with{PUBLISHED_MARK}, which marks published figures"
            )


@dataclass(slots=True, kw_only=True)
class SystemConfig:
    """A guide and a planner on a robot. Groups that hold a `_target_` are checked against that class's Config.

    filter: filter of the planner's commands; empty for none. feedback: velocity from which commands ramp. cap: highest
    speeds of the commands.
    """

    seed: int
    weights: str
    robot: Robot
    guide: dict[str, Any]
    planner: dict[str, Any]
    filter: dict[str, Any] = field(default_factory=dict)
    feedback: Feedback = Feedback.OPEN_LOOP
    cap: Cap = field(default_factory=Cap)
    ablation: dict[str, float] = field(default_factory=dict)
    system: SystemNames = field(default_factory=SystemNames)


@dataclass(slots=True, kw_only=True)
class DriveConfig(SystemConfig):
    """A system and the worlds that it drives: all that an episode depends on, besides its world and run.

    crowd: people added to the worlds; empty for none.
    """

    map: dict[str, Any]
    sim: dict[str, Any]
    crowd: dict[str, Any] = field(default_factory=dict)


@dataclass(slots=True, kw_only=True)
class RecordedConfig(DriveConfig):
    """Part of a driving run's config that `launch.json` keeps. table: rows of a sweep's table."""

    runs: int
    people: People = People.truth
    scale: dict[str, float] = field(default_factory=dict)
    table: list[str] = field(default_factory=list)


@dataclass(slots=True, kw_only=True)
class EpisodesConfig(DriveConfig):
    """Episodes that a command drives. executor: config of what runs them. resume: false, true or a directory."""

    runs: int
    resume: Any
    executor: dict[str, Any]


@dataclass(slots=True, kw_only=True)
class PictureTexts:
    """Texts of pictures: None for a picture's own, empty for none."""

    title: str | None = None
    caption: str | None = None


@dataclass(slots=True, kw_only=True)
class PictureConfig(PictureTexts):
    """Texts and width [in] of pictures. width: None for that of each picture."""

    width: float | None = None

    def __post_init__(self) -> None:
        """Raise InputError for a width that no page has."""
        if self.width is not None:
            require("width", self.width, at_least=2.0, at_most=30.0)


@dataclass(slots=True, kw_only=True)
class ReportConfig(EpisodesConfig):
    """Episodes that are driven and reported on."""

    tracking: dict[str, Any]
    table: list[str] = field(default_factory=list)
    record: Record = Record.none
    explain: Explain = Explain.none


@dataclass(slots=True, kw_only=True)
class EvalConfig(ReportConfig):
    """Config of `lme eval`. people: source of the people that the system sees. scale: factors on parameters by name.

    costmap_range: range [m] to which a guide's costmap marks and clears obstacles; None: the guide's own ranges.
    costmap_clocks: whether costmaps are rebuilt at rates of their own.
    """

    people: People = People.truth
    costmap_range: float | None = None
    costmap_clocks: bool = False
    picture: PictureConfig = field(default_factory=PictureConfig)
    scale: dict[str, float] = field(default_factory=dict)


@dataclass(slots=True)
class TrialReward:
    """Reward of a failed episode (paper eq. 1), and the longest duration of an episode."""

    crash: float
    timeout: float
    max_steps: int | None


@dataclass(slots=True, kw_only=True)
class HeldOutConfig(ReportConfig):
    """Search in some worlds, with evaluation in others. name: that of the result; held_out: map sets by name."""

    name: str | None
    held_out: dict[str, Any] = field(default_factory=dict)


@dataclass(slots=True)
class RaceConfig:
    """Rungs of the race. candidates: number in each rung. worlds: number that each rung adds of each family."""

    candidates: list[int]
    worlds: list[int]


@dataclass(slots=True)
class DisturbanceRanges:
    """Ranges [lowest, highest] that are drawn for each training world; None: the simulator's own value."""

    latency: list[float] | None = None  # [s]
    slip: list[float] | None = None  # [-]
    scan_noise: list[float] | None = None  # [m]
    natural_frequency_v: list[float] | None = None  # [rad/s]
    natural_frequency_omega: list[float] | None = None  # [rad/s]
    overshoot_v: list[float] | None = None  # [-]
    overshoot_omega: list[float] | None = None  # [-]
    ripple_v: list[float] | None = None  # [m/s]
    ripple_omega: list[float] | None = None  # [rad/s]
    tilt: list[float] | None = None  # [rad]

    @property
    def any(self) -> bool:
        """Return whether any disturbance is drawn."""
        return any(getattr(self, field.name) is not None for field in fields(self))


@dataclass(slots=True, kw_only=True)
class TrainConfig(HeldOutConfig):
    """Config of `lme train`. space: nested like the config that it searches.

    map: the only one to train on; empty: the families of `training`. training_robots: robots of families with their
    own. training_radius: greatest outer radius [m] of a robot in each narrow family. race: None if the best trial of
    the search is the result.
    """

    map: dict[str, Any] = field(default_factory=dict)
    training: dict[str, Any]
    training_robots: dict[str, Robot]
    training_radius: dict[str, float]
    race: RaceConfig | None
    disturbances: DisturbanceRanges
    trials: int
    configurations: int
    restarts: int
    training_numbers: list[int]
    start_from_config: bool
    reward: TrialReward
    storage: str | None
    study: str | None
    search: dict[str, Any]
    space: dict[str, Any]


class Device(StrEnum):
    """Device of torch. auto: a GPU if there is one."""

    auto = "auto"
    cpu = "cpu"
    cuda = "cuda"


@dataclass(slots=True)
class RobotRanges:
    """Lowest and highest values that differ from robot to robot; None: the value of the job's robot."""

    v_max: list[float] | None = None  # [m/s]
    omega_max: list[float] | None = None  # [rad/s]
    alpha_v: list[float] | None = None  # [m/s²]
    alpha_omega: list[float] | None = None  # [rad/s²]
    length: list[float] | None = None  # [m]
    width: list[float] | None = None  # [m]


@dataclass(slots=True, kw_only=True)
class LearnConfig(HeldOutConfig):
    """Config of `lme learn`. training: map sets by name; guides: shares by name; start: network to continue from."""

    learner: dict[str, Any]
    training: dict[str, Any]
    first_world: int
    validation: int
    guides: dict[str, float]
    robots: RobotRanges
    start: str | None
    threads: int
    device: Device


@dataclass(slots=True, kw_only=True)
class ReplayConfig(SystemConfig):
    """Config of `lme replay`. goal: point [x, y], topic, or none; topics, frames, scan: see runners.recordings."""

    bag: str | None
    list: bool
    goal: Any
    as_recorded: bool
    start: float
    end: float | None
    clock: str
    stale: float
    topics: dict[str, Any]
    frames: dict[str, Any]
    scan: dict[str, Any]
    ahead: float
    horizon: float
    rerun: bool
    people: People = People.tracked
    tracking: dict[str, Any]


@dataclass(slots=True, kw_only=True)
class LiveCommandConfig(DriveConfig):
    """Config of `lme live`. live: the node or the simulated robot.

    topics, frames, scan: see runners.ros and lme.live.
    """

    runs: int
    live: dict[str, Any]
    ros: int | None
    topics: dict[str, Any]
    frames: dict[str, Any]
    scan: dict[str, Any]
    people: People = People.tracked
    record: Record = Record.none


@dataclass(slots=True, kw_only=True)
class PlayConfig(DriveConfig):
    """Config of `lme play`. run: number in each world; port: that of the page; browser: whether to open it."""

    people: People = People.truth
    scale: dict[str, float] = field(default_factory=dict)
    run: int = 0
    port: int = 8765
    browser: bool = True


@dataclass(slots=True, kw_only=True)
class FigureConfig(EpisodesConfig):
    """Config of `lme figure`. figure: kind and settings; run: directory whose records are drawn, or none."""

    figure: dict[str, Any]
    run: str | None
    world: Any
    formats: list[str]
    picture: PictureTexts = field(default_factory=PictureTexts)
    scale: dict[str, float] = field(default_factory=dict)


COMMANDS: dict[str, type[SystemConfig]] = {
    "eval": EvalConfig,
    "train": TrainConfig,
    "learn": LearnConfig,
    "replay": ReplayConfig,
    "figure": FigureConfig,
    "live": LiveCommandConfig,
    "play": PlayConfig,
}


def register() -> None:
    """Make the schemas and the resolvers known to Hydra; safe to call again."""
    store = ConfigStore.instance()
    for command, schema in COMMANDS.items():
        if f"{command}_schema.yaml" not in store.repo:
            store.store(name=f"{command}_schema", node=schema)
    register_resolvers()
    OmegaConf.register_new_resolver("sweep", _sweep, replace=True)


def _sweep(options: Sequence[str], without: Collection[str] = ()) -> str:
    """Return the options of a list as a sweep: "a,b" for [a, b]; "null", which chooses nothing, for none."""
    return ",".join(option for option in options if option not in without) or "null"
