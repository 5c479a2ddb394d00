"""Run the escaper on your own scan: it takes ranges and gives a subgoal with the reason for it.

A wall blocks the path to the target. On a robot, the ranges come from its lidar, once per control period.
"""

import numpy as np

import lme

robot = lme.Robot(
    name="mine",
    footprint=lme.Footprint(radius=0.2),  # [m]
    v_max=0.5,  # [m/s]
    omega_max=1.5,  # [rad/s]
    alpha_v=2.0,  # [m/s²]
    alpha_omega=2.0,  # [rad/s²]
    control_rate=10.0,  # [Hz]
    lidar=lme.Lidar(num_beams=360, fov=2 * np.pi, range_min=0.1, range_max=10.0),
)


def wall_ahead(lidar: lme.Lidar) -> lme.LaserScan:
    """A scan of a wall at x = 1.5 m from y = -1 m to 2 m; inf for a beam without a return."""
    bearing = lidar.angle_min + lidar.angle_increment * np.arange(lidar.num_beams)
    ahead = np.cos(bearing) > 1e-6
    distance = 1.5 / np.where(ahead, np.cos(bearing), 1.0)  # [m] along each beam
    y = distance * np.sin(bearing)
    ranges = np.where(ahead & (-1.0 < y) & (y < 2.0), distance, np.inf).astype(np.float32)
    return lme.LaserScan(ranges, lidar.angle_min, lidar.angle_increment, lidar.range_min, lidar.range_max)


def main() -> None:
    escaper = lme.LocalMinimumEscaper(robot, lme.load_parameters("published"), lme.load_settings("guide/lme"))
    escaper.reset(np.random.default_rng(0))  # the source of random candidates
    observation = lme.Observation(
        scan=wall_ahead(robot.lidar),
        target=np.array([5.0, 0.0]),  # [m] in the robot frame
        twist=lme.Twist(0.0, 0.0),  # [m/s], [rad/s]
        limits=robot.limits,
        odometry=lme.Pose(0.0, 0.0, 0.0),
    )
    decision = escaper.decide(observation)
    why = escaper.explanation()
    assert why is not None  # a decision has been made
    x, y = decision.subgoal
    print(f"subgoal: {x:.2f} m ahead, {y:.2f} m to the left")
    print(f"reason: {lme.reason(why)}")
    for name, value in zip(why.names, why.features[:, why.new], strict=True):
        print(f"  {name}: {value:.2f}")


if __name__ == "__main__":
    main()
