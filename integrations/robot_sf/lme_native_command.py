"""Drives a robot of Robot SF as an outside process: a line of JSON in, a line of JSON out.

    python lme_native_command.py [--system lme_plus] [--people truth|tracked|none] [--as-is]

Robot SF starts it for each episode (`lme_native_command.yaml`, mode: persistent). It imports nothing of Robot SF.
"""

import argparse
import json
import sys
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np

import lme

LIMITS: dict[str, Any] = {
    "v_max": 2.0,
    "omega_max": 1.0,
    "alpha_v": 1.0,
    "alpha_omega": 1.0,
}  # Robot SF's defaults
RADIUS, PERSON, DT = 1.0, 0.4, 0.1  # [m], [m], [s], where a request does not say
LIDAR = lme.Lidar(num_beams=720, fov=2 * np.pi, range_min=0.0, range_max=20.0)
IN_SIGHT = 0.1  # [m] a person is in sight if the beam to them returns at most this much before their outline


class Scene(NamedTuple):
    """One request, in the world: walls (S, 4), people (P, 4) of x, y, vx, vy over ground, and their radius."""

    pose: lme.Pose
    twist: lme.Twist
    goal: np.ndarray
    walls: np.ndarray
    people: np.ndarray
    person: float
    radius: float
    dt: float


def scene_of(request: dict[str, Any]) -> Scene:
    """What a request says. Robot SF gives the velocities of people in the robot's frame, all else in the world's."""
    robot, people = request["robot"], request.get("pedestrians") or {}
    x, y = robot["position"][:2]
    yaw = _first(robot["heading"])
    speed = np.ravel(robot["speed"])
    omega = _first(robot.get("angular_velocity"), speed[1] if len(speed) > 1 else 0.0)
    geometry = request.get("static_geometry") or {}
    walls = [*geometry.get("obstacle_segments", []), *geometry.get("boundary_segments", [])]
    positions, velocities = people.get("positions") or [], people.get("velocities") or []
    count = int(_first(people.get("count"), len(positions)))  # empty rows follow
    places = np.reshape(positions, (-1, 2))[:count]
    moves = turned(np.reshape(velocities, (-1, 2))[:count], yaw)
    return Scene(
        lme.Pose(float(x), float(y), yaw),
        lme.Twist(float(speed[0]), omega),
        np.asarray(request["goal"]["current"][:2], dtype=float),
        np.reshape(walls, (-1, 4)).astype(float),
        np.hstack([places, moves]),
        _first(people.get("radius"), PERSON),
        _first(robot.get("radius"), RADIUS),
        _first((request.get("sim") or {}).get("timestep", request.get("dt")), DT),
    )


def observe(scene: Scene, robot: lme.Robot) -> lme.Observation:
    """What the robot sees: walls and people in its scan, and how the people in sight move."""
    circles = np.hstack([scene.people[:, :2], np.full((len(scene.people), 1), scene.person)])
    scan = lme.cast(robot.lidar, scene.pose, circles, scene.walls)
    here, yaw = np.array(scene.pose[:2]), scene.pose.yaw
    people = np.hstack([turned(scene.people[:, :2] - here, -yaw), turned(scene.people[:, 2:], -yaw)])
    seen = people[in_sight(people, scan, scene.person)]
    target = short_of(turned((scene.goal - here)[None], -yaw)[0], scene.radius)
    return lme.Observation(scan, target, scene.twist, robot.limits, scene.pose, seen)


def short_of(point: np.ndarray, distance: float) -> np.ndarray:
    """The place (2,) a distance [m] before a point (2,), or half-way to it if it is nearer than twice that.

    Robot SF takes a waypoint for reached a goal radius (1 m) and the robot's radius before it. The robot aims at a
    place within, because somebody may stand on the waypoint itself.
    """
    return point * max(1.0 - distance / max(float(np.hypot(*point)), 1e-9), 0.5)


def in_sight(people: np.ndarray, scan: lme.LaserScan, radius: float) -> np.ndarray:
    """(P,) whether nothing in the scan is in front of each person (P, 4) of the robot frame."""
    bearings = np.arctan2(people[:, 1], people[:, 0])
    beams = np.rint((bearings - scan.angle_min) / scan.angle_increment).astype(int) % len(scan.ranges)
    away = np.hypot(people[:, 0], people[:, 1])
    return np.asarray((scan.ranges[beams] >= away - radius - IN_SIGHT) & (away - radius < scan.range_max))


def turned(vectors: np.ndarray, angle: float) -> np.ndarray:
    """Vectors (N, 2), turned by an angle [rad]."""
    cos, sin = np.cos(angle), np.sin(angle)
    return np.asarray(vectors @ np.array([[cos, sin], [-sin, cos]]))


def reply_of(command: lme.Twist, now: lme.Twist, dt: float) -> lme.Twist:
    """What to send so that the robot's next velocity is the command.

    Robot SF's runner takes `sent − v` as an acceleration and multiplies it by dt: of a velocity that is sent as it is
    only the share dt is reached.
    """
    return lme.Twist(*(v + (wanted - v) / dt for wanted, v in zip(command, now, strict=True)))


def robot_of(scene: Scene) -> lme.Robot:
    """Robot SF's robot: a disc that cannot back up."""
    footprint = lme.Footprint(radius=scene.radius)
    return lme.Robot("robot_sf", footprint, **LIMITS, control_rate=1.0 / scene.dt, lidar=LIDAR, v_min=0.0)


def replies(requests: Iterable[str], system: str, people: str, as_is: bool = False) -> Iterator[str]:
    """The reply to each request of one episode, as lines of JSON. people: see `lme.load_system`."""
    navigator = None
    for line in requests:
        scene = scene_of(json.loads(line))
        if navigator is None:
            robot = robot_of(scene)
            # Robot SF moves exactly, and may be moving at the first request.
            navigator = lme.load_system(system, robot, people=people, feedback="CLOSED_LOOP")
            navigator.reset(np.random.default_rng(0))
        command = navigator.act(observe(scene, robot))
        v, omega = command if as_is else reply_of(command, scene.twist, scene.dt)
        yield json.dumps({"linear_velocity": v, "angular_velocity": omega})


def _first(value: Any, default: float = 0.0) -> float:
    """A number, or the first of a list of them."""
    return float(default if value is None else np.ravel(value)[0])


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--system", default="lme_plus", help="a name of conf/system/")
    parser.add_argument(
        "--people",
        choices=("truth", "tracked", "none"),
        default="tracked",
        help="where it knows people from: Robot SF (those in sight), its own tracker (the default), or nowhere",
    )
    parser.add_argument(
        "--as-is", action="store_true", help="send velocities as they are, to see what that does"
    )
    args = parser.parse_args()
    for reply in replies(sys.stdin, args.system, args.people, args.as_is):
        print(reply, flush=True)


if __name__ == "__main__":
    main()
