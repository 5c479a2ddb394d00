"""The ids, and that nothing needs Gymnasium but who asks for it."""

import subprocess
import sys

import pytest

from tests.places import ROOT

WITHOUT = "import sys; sys.modules['gymnasium'] = None; "


def run(code):
    """What Python prints for this code in a fresh process."""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, timeout=120)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_every_map_set_has_an_id():
    gym = pytest.importorskip("gymnasium")
    for path in (ROOT / "conf" / "map").glob("[!_]*.yaml"):
        name = path.stem.title().replace("_", "")
        assert gym.spec(f"lme/{name}-v0").kwargs["map"] == path.stem


@pytest.mark.parametrize(
    ("name", "robot"),
    [("Barn", "jackal"), ("Env1", "stage"), ("Real1Dynamic", "turtlebot2"), ("Go2A", "go2")],
)
def test_a_robot_that_fits_the_map_set_drives_there(name, robot):
    gym = pytest.importorskip("gymnasium")
    assert gym.spec(f"lme/{name}-v0").kwargs["robot"] == robot


def test_make_imports_lme_which_registers():
    pytest.importorskip("gymnasium")
    made = "gym.make('lme:lme/Env2-v0').unwrapped"
    assert "NavigationEnv" in run(f"import gymnasium as gym; print({made})")
    assert "NavigationEnv" in run(f"import lme, gymnasium as gym; print({made})")


def test_a_mistyped_id_names_the_right_one():
    gym = pytest.importorskip("gymnasium")
    with pytest.raises(gym.error.NameNotFound, match="Did you mean: `Barn`"):
        gym.make("lme:lme/Bran-v0")


def test_lme_neither_imports_nor_needs_gymnasium():
    assert run("import sys, lme; lme.load_robot; print('gymnasium' in sys.modules)") == "False"
    assert (
        run("import lme\ntry:\n import gymnasiun\nexcept ImportError as error:\n print(error.name)")
        == "gymnasiun"
    )
    assert run(WITHOUT + "import lme; print(lme.load_robot('stage').name)") == "stage"


def test_many_robots_are_driven_without_gymnasium():
    drive = (
        "import numpy as np; from lme.gym.fleet import Fleet; "
        "from lme.config.presets import load_map_set, load_robot; "
        "fleet = Fleet(load_map_set('barn'), load_robot('stage'), 2); fleet.reset([0, 1]); "
        "print(fleet.step(np.zeros((2, 2))).views.ranges.shape)"
    )
    assert run(WITHOUT + drive) == "(2, 540)"


def test_without_gymnasium_the_environment_says_what_to_install(says):
    code = WITHOUT + (
        "import lme\n"
        "try:\n    from lme.gym import NavigationEnv\n"
        "except lme.InputError as error:\n    print(error)"
    )
    says(run(code))
