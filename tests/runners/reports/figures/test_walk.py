"""A film of a walking Go2 by MuJoCo's renderer: what is drawn where, and what cannot be filmed."""

from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

from lme.errors import InputError
from lme.worlds.movers import Mover
from lme.worlds.world import World
from runners.cli.main import main
from runners.reports.figures.driven_runs import read_runs
from runners.reports.figures.walk import check_walked, open_gl

pytest.importorskip("mujoco", reason="sim=mujoco needs MuJoCo")
pytest.importorskip("onnxruntime", reason="the policy of sim=mujoco needs onnxruntime")

WORDS = ["robot=go2", "map=go2_a", "world=0", "runs=1", "executor=serial", "map.time_limit=3"]
FILM = ["figure.width=400", "figure.fps=2"]


@pytest.fixture(scope="module")
def film(tmp_path_factory):
    """The run directory of a film of three seconds."""
    folder = tmp_path_factory.mktemp("walk")
    try:
        open_gl(8, 8)
    except InputError as error:
        pytest.skip(str(error))
    assert main(["figure", "walk", "sim=mujoco", *WORDS, *FILM, f"hydra.run.dir={folder}"]) == 0
    return folder


def pictures(folder):
    with Image.open(folder / "walk.gif") as film:
        for number in range(film.n_frames):
            film.seek(number)
            yield np.asarray(film.convert("RGB")).astype(int)


def blue(picture):
    """Columns of the pixels of the way, in the view of the world."""
    red, green, blue = picture[30:, : int(0.6 * picture.shape[1])].transpose(2, 0, 1)
    return np.nonzero((blue - red > 60) & (blue - green > 20))[1]


def test_the_way_grows_towards_the_goal(film):
    first, *_, last = pictures(film)
    assert first.shape == last.shape
    assert last.shape[1] == 400
    assert len(blue(first)) < 5
    assert np.ptp(blue(last)) > 15


def test_the_view_of_the_robot_follows_it(film):
    """Its orange feet stay in the middle of the view at the right."""
    for picture in pictures(film):
        view = picture[22:, 255:]
        red, green, below = view.transpose(2, 0, 1)
        columns = np.nonzero((red - below > 90) & (red - green > 40))[1]
        assert 0.25 < columns.mean() / view.shape[1] < 0.75


def test_postures_are_ten_milliseconds_apart_from_start_to_end(film):
    trace = read_runs([film])[0].trace(0, 0)
    times = np.concatenate([frame.postures[:, 0] for frame in trace.frames])
    assert (times[0], times[-1]) == (0.0, pytest.approx(trace.end.time))
    assert np.diff(times).max() <= 0.01 + 1e-9
    positions = np.array([frame.postures[-1, 1:3] for frame in trace.frames])
    np.testing.assert_allclose(positions, [frame.pose[:2] for frame in trace.frames], atol=1e-9)


def test_only_robots_with_legs_are_filmed(tmp_path, capsys, says):
    assert main(["figure", "walk", *WORDS, f"hydra.run.dir={tmp_path}"]) == 2
    says(capsys.readouterr().err.splitlines()[-1])


def test_movers_are_not_filmed(says):
    world = World(movers=(Mover(path=np.zeros((1, 3)), speed=1.0, radius=0.2),))
    trace = SimpleNamespace(
        end=SimpleNamespace(postures=np.zeros((1, 20))), task=SimpleNamespace(world=world, map_name="social")
    )
    with pytest.raises(InputError) as error:
        check_walked(trace)
    says(str(error.value))
