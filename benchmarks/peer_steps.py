"""Simulators that `benchmarks.peers` compares, each as a function that drives robots for a control period."""

from __future__ import annotations

import importlib
import math
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pymunk
import yaml
from numpy.typing import NDArray

from benchmarks.fleet import OneWorld
from lme.config.presets import load_settings
from lme.gym.fleet import Fleet
from lme.robots import Robot
from lme.simulation.fast import FastSimulator
from lme.types import Floats, Twist
from lme.worlds.world import Task

# One control period of n robots: commands (n, 2) [m/s, rad/s] to poses (n, 3) and ranges from behind (n, B) [m].
Step = Callable[[Floats], tuple[Floats, NDArray[Any]]]
CELL = 0.15  # [m] of JaxNav's map, as of its own BARN maps
FIELD = 28.0  # [m] of its map: beams do not leave it


class Scene(NamedTuple):
    """A robot, and a task among discs."""

    task: Task
    robot: Robot

    @property
    def radius(self) -> float:
        """Radius of the robot [m]."""
        return self.robot.footprint.circumscribed_radius

    @property
    def bearings(self) -> Floats:
        """Bearings of the beams, from behind over the right: (B,) [rad]."""
        lidar = self.robot.lidar
        return lidar.angle_min + lidar.angle_increment * np.arange(lidar.num_beams, dtype=np.float64)


def fleet(scene: Scene, n: int) -> Step:
    """Our simulator of many robots, on one thread."""
    robots = Fleet(OneWorld(scene.task.world), scene.robot, n, load_settings("sim/fast"), threads=1)
    robots.reset(range(n))
    return lambda commands: (robots._states.poses, robots.step(commands).views.ranges)


def fast(scene: Scene) -> Step:
    """Our simulator."""
    simulator = FastSimulator(load_settings("sim/fast"), scene.robot)
    simulator.reset(scene.task, np.random.default_rng(0))

    def step(commands: Floats) -> tuple[Floats, NDArray[Any]]:
        ranges = simulator.step(Twist(*commands[0].tolist())).scan.ranges
        return np.array([simulator.state.pose]), ranges[None]

    return step


def irsim_x(scene: Scene, n: int) -> Step:
    """irsim-x's batch of worlds in C++, whose robots are octagons."""
    core: Any = importlib.import_module("cpp")
    config = core.BatchConfig()
    config.batch_size, config.share_obstacles = n, True
    worlds = core.BatchSimWorld(config)
    worlds.set_step_time(scene.robot.dt)
    worlds.set_robot_kinematics(0)  # differential drive
    worlds.set_robot_limits(*(np.full(3, limit, np.float32) for limit in (-10.0, 10.0, 1000.0)))
    corners = np.linspace(0.0, 2 * math.pi, 8, endpoint=False)
    outline = scene.radius * np.column_stack([np.cos(corners), np.sin(corners)])
    worlds.set_robot_vertices(outline.astype(np.float32))
    worlds.set_initial_poses(np.tile(scene.task.start, (n, 1)).astype(np.float32))
    for x, y, r in scene.task.world.circles.tolist():
        worlds.add_obstacle({"type": "circle", "x": x, "y": y, "radius": r})
    bearings = scene.bearings.astype(np.float32)

    def step(commands: Floats) -> tuple[Floats, NDArray[Any]]:
        actions = np.zeros((n, 3), np.float32)
        actions[:, ::2] = commands
        worlds.step(actions, 3)
        ranges = worlds.batch_raycast(bearings, scene.robot.lidar.range_max).reshape(len(bearings), -1)
        worlds.get_all_collisions()
        return worlds.get_all_poses().reshape(n, 3), ranges[:, :n].T

    return step


def jaxnav(scene: Scene, n: int) -> Step:
    """JaxNav's step of one agent, mapped over many, with the discs in a grid map."""
    jax: Any = importlib.import_module("jax")
    env_module: Any = importlib.import_module("jaxmarl.environments.jaxnav.jaxnav_env")
    lidar, cells = scene.robot.lidar, math.ceil(FIELD / CELL)
    env = env_module.JaxNav(
        num_agents=1,
        map_params={"map_size": (cells, cells), "cell_size": CELL},
        lidar_num_beams=lidar.num_beams,
        lidar_max_range=lidar.range_max,
        max_v_acc=1000.0,
        max_w_acc=1000.0,
        dt=scene.robot.dt,
    )
    env.lidar_angles = jax.numpy.asarray(scene.bearings)
    centres = (np.arange(cells) + 0.5) * CELL - FIELD / 2
    x, y, r = scene.task.world.circles.T
    solid = np.hypot(centres[None, :, None] - x, centres[:, None, None] - y) <= r
    grid = jax.numpy.asarray(solid.any(axis=2), dtype=int)
    no = jax.numpy.zeros(1, bool)

    def drive(pose: Any, twist: Any, command: Any) -> Any:
        state = env_module.State(
            pos=pose[None, :2],
            theta=pose[None, 2],
            vel=twist[None],
            done=no,
            term=no,
            goal_reached=no,
            move_term=no,
            step=0,
            ep_done=False,
            goal=jax.numpy.zeros((1, 2)),
            map_data=grid,
            rew_lambda=0.5,
        )
        views, state, *_ = env.step_env(jax.random.PRNGKey(0), state, {"agent_0": command})
        pose = jax.numpy.append(state.pos[0], state.theta[0])
        return pose, state.vel[0], env.unnormalise_lidar(views["agent_0"][: lidar.num_beams])

    drive_all = jax.jit(jax.vmap(drive))
    shift = [FIELD / 2, FIELD / 2, 0.0]  # its map begins at 0
    poses = jax.numpy.asarray(np.tile(np.add(scene.task.start, shift), (n, 1)))
    twists = jax.numpy.zeros((n, 2))

    def step(commands: Floats) -> tuple[Floats, NDArray[Any]]:
        nonlocal poses, twists
        poses, twists, ranges = drive_all(poses, twists, commands.astype(np.float32))
        return np.asarray(poses) - shift, np.asarray(ranges)

    return step


def mujoco_rays(scene: Scene) -> Step:
    """MuJoCo's step of a disc that slides and turns at given velocities, and `mj_multiRay`."""
    mujoco: Any = importlib.import_module("mujoco")
    lidar, (x, y, yaw) = scene.robot.lidar, scene.task.start
    geoms = "".join(
        f'<geom type="cylinder" size="{r} 0.5" pos="{x} {y} 0"/>'
        for x, y, r in scene.task.world.circles.tolist()
    )
    joints = "".join(
        f'<joint type="{kind}" axis="{axis}"/>'
        for kind, axis in (("slide", "1 0 0"), ("slide", "0 1 0"), ("hinge", "0 0 1"))
    )
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="{scene.robot.dt}" gravity="0 0 0"/><worldbody>{geoms}<body name="robot">{joints}'
        f'<geom type="cylinder" size="{scene.radius} 0.2" mass="10"/></body></worldbody></mujoco>'
    )
    data, body = mujoco.MjData(model), model.body("robot").id
    data.qpos[:] = x, y, yaw
    hits, distances = np.empty(lidar.num_beams, np.int32), np.empty(lidar.num_beams)
    directions, bearings = np.zeros((lidar.num_beams, 3)), scene.bearings

    def step(commands: Floats) -> tuple[Floats, NDArray[Any]]:
        (v, omega), heading = commands[0].tolist(), float(data.qpos[2])
        data.qvel[:] = v * math.cos(heading), v * math.sin(heading), omega
        mujoco.mj_step(model, data)
        x, y, yaw = data.qpos.tolist()
        directions[:, 0], directions[:, 1] = np.cos(yaw + bearings), np.sin(yaw + bearings)
        rays = directions.ravel(), None, True, body, hits, distances, None, len(hits), lidar.range_max
        mujoco.mj_multiRay(model, data, np.array([x, y, 0.0]), *rays)
        return np.array([[x, y, yaw]]), np.minimum(np.where(hits < 0, np.inf, distances), lidar.range_max)[
            None
        ]

    return step


def navground(scene: Scene) -> Step:
    """navground's world with a two-wheeled agent, its lidar and its collisions, in C++."""
    core, sim = importlib.import_module("navground.core"), importlib.import_module("navground.sim")
    world, state, robot = sim.World(), core.SensingState(), scene.robot
    for x, y, r in scene.task.world.circles:
        world.add_obstacle(core.Disc((x, y), r))
    wheels = core.kinematics.TwoWheelsDifferentialDriveKinematics(robot.v_max, scene.radius)
    agent = sim.Agent(radius=scene.radius, kinematics=wheels)
    agent.pose = core.Pose2(scene.task.start[:2], scene.task.start.yaw)
    world.add_agent(agent)
    beams = (robot.lidar.range_max, -math.pi, fov(scene), robot.lidar.num_beams)
    lidar = sim.state_estimations.LidarStateEstimation(*beams)
    lidar.prepare(agent, world)

    def step(commands: Floats) -> tuple[Floats, NDArray[Any]]:
        v, omega = commands[0].tolist()
        agent.last_cmd = core.Twist2((v, 0.0), omega, core.Frame.relative)
        world.actuate(robot.dt)
        lidar.update(agent, world, state)
        pose = np.array([[*agent.position, agent.orientation]])
        return pose, np.asarray(lidar.read_ranges(state))[None]

    return step


def fov(scene: Scene) -> float:
    """Angle from the first beam to the last [rad]."""
    beams = scene.robot.lidar.num_beams
    return 2 * math.pi * (beams - 1) / beams


def ir_sim(scene: Scene) -> Step:
    """ir-sim without its window, in Python with shapely."""
    os.environ.setdefault("MPLBACKEND", "Agg")
    irsim = importlib.import_module("irsim")
    beams = scene.robot.lidar.num_beams
    lidar = {"name": "lidar2d", "range_max": scene.robot.lidar.range_max, "angle_range": fov(scene)}
    lidar |= {"number": beams, "offset": [0.0, 0.0, -math.pi / beams]}  # its beams are symmetric about 0
    robot = {
        "kinematics": {"name": "diff"},
        "shape": {"name": "circle", "radius": scene.radius},
        "state": list(scene.task.start),
        "sensors": [lidar],
    }
    obstacles = [
        {"shape": {"name": "circle", "radius": r}, "state": [x, y, 0.0]}
        for x, y, r in scene.task.world.circles.tolist()
    ]
    size = {"step_time": scene.robot.dt, "height": 40, "width": 40, "offset": [-20, -20]}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "world.yaml"
        path.write_text(yaml.safe_dump({"world": size, "robot": [robot], "obstacle": obstacles}))
        env = irsim.make(str(path), headless=True, log_level="WARNING")

    def step(commands: Floats) -> tuple[Floats, NDArray[Any]]:
        env.step(commands.T)
        return env.robot.state[:3].T.copy(), np.asarray(env.get_lidar_scan()["ranges"])[None]

    return step


def pymunk_rays(scene: Scene) -> Step:
    """pymunk's kinematic body, a ray query for each beam and a query of the body's disc."""
    space = pymunk.Space()
    for x, y, r in scene.task.world.circles:
        space.add(pymunk.Circle(space.static_body, r, (x, y)))
    body = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
    body.position, body.angle = scene.task.start[:2], scene.task.start.yaw
    disc = pymunk.Circle(body, scene.radius)
    space.add(body, disc)
    disc.filter = pymunk.ShapeFilter(group=1)
    accept = pymunk.ShapeFilter(group=1)  # rays do not hit the robot
    bearings, reach = scene.bearings, scene.robot.lidar.range_max

    def step(commands: Floats) -> tuple[Floats, NDArray[Any]]:
        v, body.angular_velocity = commands[0].tolist()
        body.velocity = body.rotation_vector * v
        space.step(scene.robot.dt)
        space.shape_query(disc)
        position, angles = body.position, body.angle + bearings
        ends = np.column_stack([np.cos(angles), np.sin(angles)]) * reach + position
        hits = [space.segment_query_first(position, end, 0.0, accept) for end in ends.tolist()]
        ranges = np.array([reach * hit.alpha if hit else reach for hit in hits])
        return np.array([[*position, body.angle]]), ranges[None]

    return step


def stage_world(scene: Scene, simulated: float) -> str:
    """Stage's file of the world, with cylinders of 16 sides; its own controller "wander" drives there."""
    dt, radius, lidar = scene.robot.dt, scene.radius, scene.robot.lidar
    period = f"update_interval {1000 * dt:.0f}"
    sensor = f"sensor ( range [0 {lidar.range_max}] fov 360 samples {lidar.num_beams} )"
    body = (
        f'size [{2 * radius} {2 * radius} 0.2] {_disc_block()} drive "diff" localization "gps" ctrl "wander"'
    )
    x, y, yaw = scene.task.start
    pose = f"pose [{x} {y} 0 {math.degrees(yaw)}]"
    lines = [f"interval_sim {1000 * dt:.0f}", f"quit_time {simulated}", "resolution 0.02"]
    lines.append(f"define lidar ranger ( {sensor} size [0.05 0.05 0.1] {period} )")
    lines.append(f"define cylinder model ( boundary 0 {_disc_block()} )")
    lines.append(f"position ( {body} {pose} {period} lidar ( pose [0 0 0 0] ) )")
    lines += [
        f"cylinder ( size [{2 * r} {2 * r} 1] pose [{x} {y} 0 0] )"
        for x, y, r in scene.task.world.circles.tolist()
    ]
    return "\n".join(lines)


def _disc_block(sides: int = 16) -> str:
    """A disc as one of Stage's blocks, which it stretches to the size of the model."""
    angles = 2 * math.pi / sides * np.arange(sides)
    corners = (f"point[{i}] [{math.cos(a):.4f} {math.sin(a):.4f}]" for i, a in enumerate(angles))
    return f"block ( points {sides} {' '.join(corners)} z [0 1] )"
