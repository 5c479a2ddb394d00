"""Drive LME through a BARN world and plot the path as world_218.png in the current folder."""

import sys

import numpy as np

import lme

try:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt
    from matplotlib.patches import Circle
except ModuleNotFoundError:
    sys.exit("drive_one_world.py needs Matplotlib for its plot: pip install matplotlib")


def main(world: int) -> None:
    robot = lme.load_robot("jackal")
    guide = lme.Lme(lme.load_settings("guide/lme", parameters=lme.load_parameters("published")), robot)
    navigator = lme.Navigator(guide, lme.Simple(lme.load_settings("planner/simple"), robot), dt=robot.dt)
    simulator = lme.FastSimulator(lme.load_settings("sim/fast"), robot)
    task = lme.Barn(lme.load_settings("map/barn", worlds=[world])).task(world)
    episode = lme.run_episode(task, navigator, simulator, np.random.default_rng(0))
    print(f"{episode.outcome} after {episode.time:.1f} s and {episode.path_length:.1f} m")

    # The columns of a trajectory are lme.navigation.episode.TRAJECTORY_COLUMNS, in the world frame.
    figure, axes = plt.subplots(figsize=(4, 8))
    for x, y, radius in task.world.circles:
        axes.add_patch(Circle((x, y), radius, color="0.4"))
    axes.plot(episode.trajectory[:, 1], episode.trajectory[:, 2], label="path")
    subgoals = episode.trajectory[episode.trajectory[:, 8] == 1.0, 6:8]  # new subgoals only
    axes.plot(*subgoals.T, "+", label="subgoals")
    axes.plot(*task.goal, "*", markersize=12, label="goal")
    axes.set(title=f"BARN world {world}: {episode.outcome}", xlabel="x [m]", ylabel="y [m]", aspect="equal")
    axes.legend(loc="lower center")
    figure.savefig(f"world_{world}.png", bbox_inches="tight")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 218)
