"""`lme replay` from end to end: what it writes, and that the same drive recorded in any way decides the same."""

import json
import math
import warnings

import numpy as np
import pytest

from tests.places import SHARED

pytest.importorskip("rosbags")

import pandas as pd

from lme.live.messages import Tilt
from lme.types import Pose
from runners.cli.main import main
from runners.recordings import figures, report
from tests.made_bags import BEGAN, OTHERS, SECOND, drive, way

BAGS = SHARED / "bags"
DECIDED = ["target_x_m", "target_y_m", "subgoal_x_m", "subgoal_y_m", "command_v_mps", "command_omega_radps"]
SIX = {"feature_a_close", "feature_a_dev", "feature_c_o", "feature_c_t", "feature_a_mount", "feature_c_h"}


def lme(*words):
    return main([str(word) for word in words])


@pytest.fixture
def replay(tmp_path, monkeypatch):
    """Replays a recording and returns its table; the directory is `replay.folder`."""
    monkeypatch.chdir(tmp_path)
    count = iter(range(100))

    def run(path, *words, quiet=("tracking=none",), drawn=False):
        if not drawn:
            monkeypatch.setattr(figures, "write", lambda *_: [])
        run.folder = tmp_path / f"run{next(count)}"
        assert lme("replay", f"bag={path}", f"hydra.run.dir={run.folder}", *quiet, *words) == 0
        return pd.read_parquet(run.folder / "replay.parquet")

    return run


def fails(capsys, *words):
    """The one line that is said."""
    capsys.readouterr()
    assert lme("replay", "tracking=none", *words) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1, said
    return said


def assert_same(one, other, atol=1e-6):
    assert len(one) == len(other)
    np.testing.assert_allclose(one[DECIDED], other[DECIDED], atol=atol)


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    return drive(".mcap").write(tmp_path_factory.mktemp("plain"))


def test_a_replay_writes_its_records_and_figures(replay, plain, capsys):
    table = replay(plain, drawn=True)
    assert {path.name for path in replay.folder.iterdir()} >= {
        "replay.parquet", "agreement.json", "replay.png", "orientation.png", "launch.json",
    }  # fmt: skip
    found = json.loads((replay.folder / "agreement.json").read_text())
    assert found["ticks"] == len(table) == 30  # 6 s at 5 Hz
    assert found["decision_ms_p50"] <= found["decision_ms_p99"] <= found["decision_ms_max"]
    assert {
        "heading_error_median_deg",
        "speed_error_abs_mean_mps",
        "command_clearance_p05_m",
        "missed_deadlines",
    } <= {*found}
    assert set(table) >= SIX
    assert table["feature_c_o"].isin([0.0, 1.0]).all()
    shown = capsys.readouterr().out
    assert "30 decisions" in shown
    assert "mounted as tf says" in shown
    assert f"scans    {found['beams_without_return']} of {30 * 360} beams without return, 0 scans" in shown


def test_one_of_anything_is_counted_in_the_singular(replay, plain):
    replay(plain)
    found = json.loads((replay.folder / "agreement.json").read_text())
    once = {"ticks": 1, "skipped_no_pose": 1, "scans_without_point": 1}
    first, *_, last = report.lines({**found, **once}, ahead=1.0)
    assert first.startswith("1 decision over 5.8 s, 1 tick left out, ")
    assert last.endswith(", 1 scan without a point")


def test_the_table_says_what_the_robot_did(replay, plain):
    table = replay(plain)
    poses = np.array([pose for pose, _, _ in way(60)])[::2]
    np.testing.assert_allclose(table[["x_m", "y_m", "yaw_rad"]], poses, atol=1e-9)
    np.testing.assert_allclose(table["v_mps"], 0.25)
    np.testing.assert_array_equal(table["recorded_command_omega_radps"], table["omega_radps"])
    np.testing.assert_allclose(table["time_s"], np.arange(30) * 0.2, atol=1e-6)


def test_headings_are_not_compared_with_places_that_the_robot_never_reached(replay, plain, capsys):
    replay(plain, "ahead=100")
    assert "not compared: the robot never got 100 m (ahead) away" in capsys.readouterr().out


def test_the_goal_is_where_the_recording_ends(replay, plain):
    last = way(60)[-1][0]
    table = replay(plain)
    reach = np.hypot(table["target_x_m"], table["target_y_m"])
    np.testing.assert_allclose(reach, np.hypot(last.x - table["x_m"], last.y - table["y_m"]), atol=1e-9)
    cut = replay(plain, "end=3.05")
    assert len(cut) == 16
    assert np.hypot(cut["target_x_m"], cut["target_y_m"]).iloc[-1] < 0.01


def test_the_map_shows_the_path_the_start_and_a_goal_beyond_all_scans_whole(replay, plain, monkeypatch):
    maps = []
    monkeypatch.setattr(figures, "save", lambda figure, *_: maps.append(figure.axes[0]))
    goal = (-31.0, 17.0)
    table = replay(plain, f"goal=[{goal[0]},{goal[1]}]", drawn=True)
    axes = maps[0]
    lines = {line.get_label(): line for line in axes.lines}
    drawn = np.vstack([line.get_xydata() for line in axes.lines if len(line.get_xydata())])
    low, high = np.transpose([axes.get_xlim(), axes.get_ylim()])
    assert (low < drawn).all()
    assert (drawn < high).all()
    assert lines["goal"].get_xydata() == pytest.approx(np.array([goal]), abs=1e-6)
    assert lines["robot"].get_xydata() == pytest.approx(table[["x_m", "y_m"]].to_numpy())
    assert lines["start"].get_xydata()[0] == pytest.approx(table[["x_m", "y_m"]].iloc[0].to_numpy())
    tip = lines["start"].get_marker().vertices[0]
    assert math.atan2(tip[1], tip[0]) == pytest.approx(table["yaw_rad"].iloc[0])


@pytest.mark.parametrize("goal", [(-60.0, 0.0), (0.0, 60.0)])  # a flat map, and a narrow one
def test_the_legend_is_between_the_map_and_the_heading(replay, plain, monkeypatch, goal):
    drawn = []
    monkeypatch.setattr(figures, "save", lambda figure, *_: drawn.append(figure))
    replay(plain, f"goal=[{goal[0]},{goal[1]}]", drawn=True)
    drawn[0].canvas.draw()
    axes, (heading,) = drawn[0].axes[0], drawn[0].texts
    legend, heading = axes.get_legend().get_window_extent(), heading.get_window_extent()
    assert axes.get_window_extent().y1 <= legend.y0
    assert legend.y1 < heading.y0
    assert not legend.overlaps(drawn[0].axes[1].get_tightbbox())
    assert axes.get_tightbbox().x0 > 0  # the names of the axes are on the page


def test_a_goal_in_the_odometry_frame(replay, plain):
    table = replay(plain, "goal=[6.0,-1.5]")
    x, y, yaw = table[["x_m", "y_m", "yaw_rad"]].to_numpy().T
    ahead = (6.0 - x) * np.cos(yaw) + (-1.5 - y) * np.sin(yaw)
    np.testing.assert_allclose(table["target_x_m"], ahead, atol=1e-9)


def test_a_goal_in_millimetres_is_noticed(replay, plain):
    with pytest.warns(UserWarning, match=r"goal is \[6000, 0\]: .* is it in millimetres"):
        replay(plain, "goal=[6000,0]")


def test_goals_of_a_topic_come_by_tf(replay, tmp_path):
    maker = drive()
    maker.add(
        "/tf_static", "tf2_msgs/msg/TFMessage", BEGAN, maker.transform(0, "map", "odom", Pose(-1.0, 2.0, 0.5))
    )
    at = Pose(
        -1.0 + 6.0 * math.cos(0.5) + 1.5 * math.sin(0.5), 2.0 + 6.0 * math.sin(0.5) - 1.5 * math.cos(0.5), 0.0
    )
    told = maker.pose_stamped(BEGAN + SECOND, "map", at)
    maker.add("/move_base_simple/goal", "geometry_msgs/msg/PoseStamped", BEGAN + SECOND - 1000, told)
    path = maker.write(tmp_path)
    told = replay(path, "goal=/move_base_simple/goal")
    given = replay(path, "goal=[6.0,-1.5]")
    assert len(told) == len(given) - 5
    targets = ["target_x_m", "target_y_m"]
    np.testing.assert_allclose(told[targets], given[targets].iloc[5:], atol=1e-6)


# The same drive, recorded differently


@pytest.mark.parametrize(
    "other",
    [
        {"suffix": ".bag"},
        {"suffix": ".db3"},
        {"clockwise": True},
        {"stamps": lambda stamp: stamp - 8 * 86400 * SECOND},
        {"stamps": lambda stamp: 0},
    ],
    ids=["ros1", "sqlite", "clockwise", "another clock", "no stamps"],
)
def test_replaying_a_drive_gives_its_decisions(replay, plain, tmp_path, other):
    told = drive(**other).write(tmp_path, "other")
    assert_same(replay(told), replay(plain), atol=2e-4 if other.get("clockwise") else 1e-6)


def test_a_lidar_upside_down_sees_the_same_obstacles(replay, plain, tmp_path):
    """Its beams run clockwise seen from above, and tf says so."""
    hanging = drive(roll=math.pi, clockwise=True)
    table, upright = replay(hanging.write(tmp_path)), replay(plain)
    np.testing.assert_allclose(table["clearance_m"], upright["clearance_m"], atol=1e-3)


@pytest.mark.parametrize("other", OTHERS.values(), ids=OTHERS)
def test_replays_of_two_robots_on_the_same_way_see_the_same_obstacles(replay, plain, tmp_path, other):
    table, told = replay(drive(**other).write(tmp_path)), replay(plain)
    np.testing.assert_allclose(table[["x_m", "y_m", "yaw_rad"]], told[["x_m", "y_m", "yaw_rad"]], atol=1e-9)
    np.testing.assert_allclose(
        table[["v_mps", "omega_radps"]][2:], told[["v_mps", "omega_radps"]][2:], atol=0.08
    )
    np.testing.assert_allclose(table["v_mps"][2:], told["v_mps"][2:], atol=5e-3)
    np.testing.assert_allclose(table["clearance_m"], told["clearance_m"], atol=0.02)


def test_a_cloud_is_flattened(replay, plain, tmp_path):
    """Points of the floor do not become obstacles; 0.2 m up the lidar, walls are seen."""
    table, told = replay(drive(scans="cloud").write(tmp_path)), replay(plain)
    assert (table["clearance_m"] > 0.2).any()
    np.testing.assert_allclose(table["clearance_m"], told["clearance_m"], atol=0.02)


@pytest.mark.parametrize("tilted", ["poses", "imu"])
def test_the_cloud_of_a_robot_that_rocks_is_levelled(replay, plain, tmp_path, tilted):
    rocking = {"scans": "cloud", "tilt": lambda k: Tilt(0.05 * math.sin(k), 0.09 * math.cos(2 * k))}
    table, told = replay(drive(**rocking, tilted=(tilted,)).write(tmp_path)), replay(plain)
    np.testing.assert_allclose(table["clearance_m"], told["clearance_m"], atol=0.02)
    np.testing.assert_allclose(table["scan_points"], told["scan_points"], rtol=0.3)


def test_the_cloud_of_a_robot_that_rocks_is_not_levelled_if_nothing_says_so(replay, plain, tmp_path):
    rocking = {"scans": "cloud", "tilt": lambda k: Tilt(0.05 * math.sin(k), 0.09 * math.cos(2 * k))}
    path = drive(**rocking, tilted=()).write(tmp_path)
    with pytest.warns(UserWarning, match="a cloud is read as if the robot never tilted"):
        table = replay(path)
    assert (table["clearance_m"] - replay(plain)["clearance_m"]).abs().max() > 0.1
    with warnings.catch_warnings():
        warnings.filterwarnings("error", message="a cloud is read")
        pd.testing.assert_series_equal(
            replay(path, "scan.cloud.level=false")["clearance_m"], table["clearance_m"]
        )


def test_velocities_from_the_poses_where_that_is_asked_for(replay, plain):
    table = replay(plain, "topics.twist=poses")
    np.testing.assert_allclose(table["v_mps"][2:], 0.25, atol=5e-3)
    assert (table["v_mps"] != 0.25).any()


def test_the_robots_own_lidar_where_it_is_asked_for(replay, plain, capsys):
    table = replay(plain, "scan.lidar=robot")
    assert "270 beams over 360°" in capsys.readouterr().out
    np.testing.assert_allclose(table["clearance_m"], replay(plain)["clearance_m"], atol=0.02)


def test_slow_scans_set_the_pace(replay, tmp_path):
    """The policy carries old subgoals on by the control period: it must be the time between decisions."""
    maker = drive(steps=60)
    slow = [m for k, m in enumerate(maker.messages) if m[1] != "/scan" or (m[0] - BEGAN) % (SECOND // 2) == 0]
    maker.messages = slow
    table = replay(maker.write(tmp_path))
    np.testing.assert_allclose(np.diff(table["time_s"]), 0.5, atol=1e-6)


@pytest.mark.parametrize(
    ("guide", "planner"), [("target", "dwa"), ("global_path", "eband"), ("tangent_bug", "simple")]
)
def test_any_pair_may_decide(replay, plain, guide, planner):
    table = replay(plain, f"guide={guide}", f"planner={planner}", "robot=jackal", "end=2")
    assert not SIX & set(table)
    assert table[["command_v_mps", "command_omega_radps"]].notna().all().all()


def test_a_replay_is_logged_to_mlflow(replay, plain, tmp_path):
    import mlflow

    uri = f"sqlite:///{tmp_path}/mlflow.db"
    replay(plain, f"tracking.uri={uri}", "end=1", quiet=())
    run = mlflow.MlflowClient(uri).search_runs(["1"])[0]
    assert run.data.metrics["ticks"] == 5
    assert run.data.tags["command"] == "replay"


def test_an_interactive_recording_where_it_is_asked_for(replay, plain):
    pytest.importorskip("rerun")
    replay(plain, "rerun=true", "end=1")
    assert (replay.folder / "replay.rrd").stat().st_size > 10_000


def test_the_interactive_map_does_not_swap_left_and_right(replay, plain, monkeypatch):
    # rerun's 2D views have y downwards, as images have.
    rerun = pytest.importorskip("rerun")
    logged = []

    def note(_stream, name, shape, **_):
        logged.append((name, shape))

    monkeypatch.setattr(rerun.RecordingStream, "log", note)
    table = replay(plain, "rerun=true", "end=1")
    shown = {name: type(shape).__name__ for name, shape in logged if name.startswith("map")}
    assert shown.pop("map") == "ViewCoordinates"
    assert all(kind.endswith("3D") for kind in shown.values()), shown
    first = next(shape for name, shape in logged if name == "map/robot").positions.as_arrow_array()
    np.testing.assert_allclose(first.to_pylist(), [[*table.loc[0, ["x_m", "y_m"]], 0.0]], atol=1e-6)


# Our own recordings


@pytest.mark.parametrize("words", [("robot=stage",), ("robot=jackal", "guide=global_path", "planner=eband")])
def test_a_recording_of_eval_gives_the_very_same_decisions(replay, tmp_path, words):
    run = tmp_path / "eval"
    assert lme("eval", "map=traps", "map.worlds=[1]", "runs=2", "seed=5", "record=mcap", "tracking=none",
               "executor=serial", f"hydra.run.dir={run}", *words) == 0  # fmt: skip
    table = replay(run / "recordings" / "world-1-run-1.mcap")
    driven = pd.read_parquet(run / "trajectories.parquet")
    driven = driven[driven["run"] == 1].iloc[:-1]
    assert len(table) == len(driven)
    for name in ("v_mps", "omega_radps"):
        np.testing.assert_array_equal(table[f"command_{name}"], table[f"recorded_command_{name}"])
        np.testing.assert_array_equal(table[name], driven[name])
    np.testing.assert_array_equal(table["switched"], driven["switched"].astype(bool))
    assert json.loads((replay.folder / "agreement.json").read_text())["same_command"] == 1.0


def test_another_system_on_a_recording_of_eval_must_be_asked_for(replay, tmp_path, capsys):
    run = tmp_path / "eval"
    lme("eval", "map=traps", "map.worlds=[1]", "runs=1", "robot=stage", "record=mcap", "tracking=none",
        "executor=serial", f"hydra.run.dir={run}")  # fmt: skip
    path = run / "recordings" / "world-1-run-0.mcap"
    assert "add as_recorded=false" in fails(capsys, f"bag={path}", "guide=target")
    table = replay(path, "guide=target", "as_recorded=false", "robot=stage")
    assert not SIX & set(table)


# Mistakes


@pytest.mark.parametrize(
    "words",
    [
        ["clock=sundial"],
        ["scan.lidar=both"],
        ["scan.mount=[1,2]"],
        ["scan.range_min=-1"],
        ["goal=[1,2,3]"],
        ["goal=/nowhere"],
        ["end=2", "start=3"],
        ["start=100"],
        ["horizon=0"],
        ["topic.scan=/scan"],
        ["topics.twist=slope"],
    ],
    ids=" ".join,
)  # fmt: skip
def test_a_mistake_is_one_line(plain, capsys, tmp_path, monkeypatch, words, says):
    monkeypatch.chdir(tmp_path)
    says(fails(capsys, f"bag={plain}", *words))


def test_replay_without_a_recording_is_an_error(capsys):
    assert "bag is null" in fails(capsys)


def test_time_going_backwards_is_reported(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    jump = drive(stamps=lambda stamp: stamp if stamp < BEGAN + 3 * SECOND else stamp - 2 * SECOND).write(
        tmp_path
    )
    assert "goes backwards by" in fails(capsys, f"bag={jump}")
    assert lme("replay", f"bag={jump}", "clock=recorded", "tracking=none") == 0


def test_poses_and_scans_that_never_meet(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    maker = drive(steps=40)
    maker.messages = [m for m in maker.messages if m[1] != "/odom" or m[0] > BEGAN + 3 * SECOND]
    maker.messages = [m for m in maker.messages if m[1] != "/scan" or m[0] < BEGAN + 2 * SECOND]
    assert "10 without a pose" in fails(capsys, f"bag={maker.write(tmp_path)}")


@pytest.mark.parametrize("x", [math.nan, 1e230])
def test_absurd_poses_do_not_count(replay, tmp_path, x):
    maker = drive(steps=40)
    for k in range(0, 40, 8):
        late = BEGAN + k * SECOND // 10 + SECOND // 20
        maker.add("/odom", "nav_msgs/msg/Odometry", late, maker.odometry(late, Pose(x, 0.0, 0.0), x, 0.0))
    table = replay(maker.write(tmp_path))
    assert len(table) > 10
    assert (table[["x_m", "v_mps"]].abs() < 100.0).all(axis=None)
    assert table[["command_v_mps", "command_omega_radps"]].notna().all(axis=None)


def test_a_second_replay_into_the_same_directory(replay, plain, capsys):
    replay(plain, "end=1")
    assert "already holds a replay" in fails(capsys, f"bag={plain}", f"hydra.run.dir={replay.folder}")


# Real robots


@pytest.mark.skipif(not BAGS.is_dir(), reason="the shared recordings are not here")
@pytest.mark.parametrize("path", sorted(BAGS.glob("*.bag")), ids=lambda p: p.stem)
def test_recordings_of_real_robots_replay_with_defaults(replay, path):
    table = replay(path)
    found = json.loads((replay.folder / "agreement.json").read_text())
    assert len(table) > 300
    assert found["skipped_no_pose"] <= 2
    assert found["times_real_time"] > 20
    assert found["missed_deadlines"] == 0
    assert table["scan_points"].median() > 300
    assert table[DECIDED].notna().all().all()


def test_the_first_word_is_the_recording(tmp_path, monkeypatch, capsys, says):
    monkeypatch.chdir(tmp_path)
    assert main(["replay", "drives/of may.bag"]) == 2
    says(capsys.readouterr().err)
    assert main(["replay", "drives/of may.bag", "list=true"]) == 2
    says(capsys.readouterr().err)
