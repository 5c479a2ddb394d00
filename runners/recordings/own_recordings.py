"""Recordings that lme wrote, with the config and the seed: which episode they hold, and its decisions made again.

`lme explain` draws the decisions with everything behind them.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lme.errors import InputError
from lme.geometry.collision import sweep
from lme.geometry.frames import to_robot, to_world
from lme.guides.lme.explanation import Decision
from lme.inputs.guarded_file import decode_json
from lme.live.messages import ODOMETRY, SECOND, TWIST, pose_of, twist_of
from lme.live.step import LiveState
from lme.navigation.navigator import MapReader, Navigator
from lme.perception.scan_points import obstacle_points
from lme.robots import Robot
from lme.types import LaserScan, Observation, Pose, Twist
from lme.worlds.world import Task, World
from runners.config import build
from runners.config.schema import RecordedConfig
from runners.recordings.bags import EPISODE, Bag, Message
from runners.records.launch_record import read_launch, recorded_config
from runners.records.trust import UntrustedError
from runners.workers.episodes import episode_rng
from runners.workers.mcap_episodes import STATE, TAKEN, WANTED
from runners.workers.trace import Drive, Trace, TracedStep, TraceEnd, rerun

GOAL, ODOM, SCAN, SENT = "/goal", "/odom", "/scan", "/cmd_vel"
GROUPS = ("robot", "guide", "planner", "filter", "feedback", "cap")
_NOTHING = np.empty((0, 3)), np.empty((0, 4))
_NO_SUBGOAL = (np.nan, np.nan, 0.0)


class RecordedEpisode(NamedTuple):
    """An episode of `lme eval`, or a drive of `lme live` to one goal, whose number is then `world`.

    config: of the command. scan: the geometry of every scan, as in `LaserScan`. goal_tolerance: of a drive of `lme
    live` [m]; None for an episode.
    """

    seed: int
    world: int
    run: int
    config: RecordedConfig
    scan: dict[str, float]
    goal_tolerance: float | None

    @property
    def live(self) -> bool:
        """Return whether this is a drive of `lme live`."""
        return self.goal_tolerance is not None

    @property
    def command(self) -> str:
        """Return the topic of the planner's commands.

        The commands that `lme live` sends are limited, and zero while the robot must stop.
        """
        return WANTED if self.live else "/cmd_vel"

    def __str__(self) -> str:
        if self.live:
            return f"goal {self.world}, seed {self.seed} of lme live"
        return f"world {self.world}, run {self.run}, seed {self.seed} of lme eval"

    def rng(self) -> np.random.Generator:
        """Return the random generator of the navigator, spawned as in the episode."""
        return episode_rng(self.seed, self.world, self.run).spawn(2)[0]

    def read_map(self, navigator: Navigator) -> None:
        """Give the true map to a guide that reads it, if the episode had one."""
        if isinstance(navigator.guide, MapReader) and not self.live:
            task = build.map_set(self.config, [self.world]).task(self.world)
            navigator.read_map(task.world, task.start)


def episode_of(bag: Bag) -> RecordedEpisode | None:
    """Return the episode if lme wrote the recording, else None. Raises InputError if its data are invalid."""
    if not bag.by_lme:
        return None
    text = next((message.content.data for message in bag.messages([EPISODE])), "")
    try:
        metadata = decode_json(text)
        seed, world, run = (int(metadata[name]) for name in ("seed", "world", "run"))
        scan, tolerance = dict(metadata["scan"]), metadata.get("goal_tolerance")
        return RecordedEpisode(seed, world, run, _config(bag.path, metadata["config"]), scan, tolerance)
    except UntrustedError:
        raise
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise InputError(
            f"bag {bag.path}: {EPISODE} does not say which episode this is: set as_recorded=false"
        ) from error


def _config(path: Path, values: dict[str, Any]) -> RecordedConfig:
    """Return the config in a recording. The files that it names are copies in the run that holds the recording."""
    launches = (read_launch(folder) for folder in (path.parent, path.parent.parent))
    run = next((launch for launch in launches if launch is not None), None)
    return recorded_config(values, path.parent, [] if run is None else run.inputs)


class _Moment(NamedTuple):
    """The time [s] and observation of a decision, and the planner's command; None at the end.

    taken: stamp of the scan [s]; None if the recording does not contain it.
    """

    time: float
    taken: float | None
    observation: Observation
    command: Twist | None


def retrace(path: Path) -> Trace:
    """Return the trace of a recording by `lme eval` or `lme live`.

    A simulated episode is driven again. For a real robot, whose world is unknown, only the decisions are repeated.
    Raises InputError if lme did not make the recording, or if a decision differs from the recorded one.
    """
    with Bag(path) as bag:
        episode = episode_of(bag)
        if episode is None:
            raise InputError(
                f"bag {path}: neither lme eval nor lme live made this recording, so it has no decisions: "
                "make some with lme replay"
            )
        if not episode.live:
            return rerun(episode.config, episode.world, episode.run)
        *moments, final = _moments(bag, episode)
        states = [message.content.data for message in bag.messages([STATE])][-1]
    if not moments:
        raise InputError(f"bag {path}: has no decisions")
    # Decide again on everything that was seen, then put the trace together.
    steps = _decide_again(path, episode, moments)
    rows = [_row(episode.config.robot, moment) for moment in (*moments, final)]
    ending = TraceEnd(final.time, final.observation.odometry, final.observation, _NOTHING)
    drive = Drive(_outcome(states, final, episode.goal_tolerance), final.time, np.array(rows))
    config, robot = episode.config, episode.config.robot
    return Trace(config, episode.world, episode.run, robot, _task(episode, moments), steps, ending, drive)


def _outcome(state_text: str, final: _Moment, tolerance: float | None) -> str:
    """Return how the drive ended. state_text: the driver's last state; a safety stop if the simulator ended first."""
    state = state_text.partition(":")[0]
    distance = float(np.hypot(*final.observation.target))
    if state in (LiveState.ARRIVED, LiveState.CANCELLED):
        return state
    return str(LiveState.ARRIVED) if distance <= (tolerance or 0.0) else f"{distance:.2f} m from the goal"


def _moments(bag: Bag, episode: RecordedEpisode) -> Iterator[_Moment]:
    """Yield every decision, and the end, which is the last pose without a scan."""
    latest: dict[str, Message] = {}
    start_stamp = None
    # A command of the planner marks a decision on the latest messages of all other topics.
    for message in bag.messages([ODOM, GOAL, SCAN, TAKEN, WANTED, SENT]):
        latest[message.topic] = message
        if message.topic == WANTED:
            start_stamp = message.recorded if start_stamp is None else start_stamp
            observation = _observation(episode, latest)
            time = (message.recorded - start_stamp) / SECOND
            decision_time = int(latest[TAKEN].content.data) / SECOND if TAKEN in latest else None
            yield _Moment(time, decision_time, observation, twist_of(message.content, TWIST))
    # At the end there is a pose, but no scan that would belong to it.
    if start_stamp is not None:
        odometry = latest[ODOM]
        pose = pose_of(odometry.content, ODOMETRY)
        goal = to_world(observation.target, observation.odometry)
        unseen = observation.scan._replace(ranges=np.full_like(observation.scan.ranges, np.inf))
        final = Observation(unseen, to_robot(goal, pose), Twist(0.0, 0.0), observation.limits, pose)
        yield _Moment((odometry.recorded - start_stamp) / SECOND, None, final, None)


def _observation(episode: RecordedEpisode, latest: dict[str, Message]) -> Observation:
    goal, odometry, scan = (latest[topic].content for topic in (GOAL, ODOM, SCAN))
    last_command = twist_of(latest[SENT].content, TWIST) if SENT in latest else None
    return Observation(
        LaserScan(np.asarray(scan.ranges, np.float32), **episode.scan),
        np.array([goal.pose.position.x, goal.pose.position.y]),
        twist_of(odometry, ODOMETRY),
        episode.config.robot.limits,
        pose_of(odometry, ODOMETRY),
        last_command=last_command,
    )


def _decide_again(path: Path, episode: RecordedEpisode, moments: list[_Moment]) -> tuple[TracedStep, ...]:
    navigator = build.navigator(episode.config)
    navigator.reset(episode.rng())
    steps: list[TracedStep] = []
    explained_decision: Decision | None = None
    # Every decision must equal the recorded one; an explanation that has not changed is kept once.
    for time, decision_time, unseen, recorded in moments:
        command = navigator.act(unseen, decision_time)
        if command != recorded:
            raise InputError(
                f"bag {path}: the decision at {time:.1f} s differs from the recorded one: another version of lme made "
                "the recording, or the guide or planner failed before it"
            )
        observation = navigator.observation
        assert navigator.guidance is not None
        assert observation is not None
        explanation = navigator.explanation()
        new_explanation = (
            None if explanation is None or explanation.decision is explained_decision else explanation
        )
        explained_decision = None if explanation is None else explanation.decision
        pose = observation.odometry
        subgoal = to_world(navigator.guidance.subgoal, pose)
        steps.append(
            TracedStep(
                time, pose, observation, subgoal, navigator.guidance, command, _NOTHING, new_explanation
            )
        )
    return tuple(steps)


def _row(robot: Robot, moment: _Moment) -> tuple[float, ...]:
    """Return a row of a trajectory. Its clearance is the distance to the scan points; NaN at the end."""
    observation = moment.observation
    if moment.command is None:
        return (moment.time, *observation.odometry, *observation.twist, *_NO_SUBGOAL, np.nan)
    points = obstacle_points(observation.scan, robot.lidar.mount)
    circles = np.column_stack((points, np.zeros(len(points))))
    clearance, _ = sweep(np.zeros((1, 3)), robot.footprint.box, circles, _NOTHING[1])
    return (moment.time, *observation.odometry, *observation.twist, *_NO_SUBGOAL, clearance)


def _task(episode: RecordedEpisode, moments: list[_Moment]) -> Task:
    first_observation, last_observation = moments[0].observation, moments[-1].observation
    assert episode.goal_tolerance is not None
    return Task(
        map_name="live, goal",
        number=episode.world,
        world=World(),
        start=Pose(*first_observation.odometry),
        goal=to_world(last_observation.target, last_observation.odometry),
        goal_tolerance=episode.goal_tolerance,
        time_limit=np.inf,
        clock_distance=0.0,
        shortest_path_length=float(np.hypot(*first_observation.target)),
        optimal_time=np.nan,
    )
