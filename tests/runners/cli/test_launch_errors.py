"""Bad command lines and bad YAMLs: one line with key, value and what would be right; nothing written."""

import copy
from pathlib import Path

import pytest
from hydra.core.config_store import ConfigStore
from hypothesis import given
from hypothesis import strategies as st

from lme.errors import InputError
from lme.inputs.resources import resource_dir
from runners.cli.launch import Command
from runners.cli.launch import launch as run_launch
from runners.config import schema
from runners.config.composer import Composer
from runners.config.quoting import quoted

ROBOT = (resource_dir("conf") / "robot" / "jackal.yaml").read_text()


@pytest.fixture
def launch(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def launch(*argv, command="eval"):
        """The message of the InputError that this must raise, with nothing written."""
        before = sorted(Path().rglob("*"))
        with pytest.raises(InputError) as caught:
            run_launch(Command(command, _never, lambda job: None), argv)
        assert sorted(Path().rglob("*")) == before
        message = str(caught.value)
        assert "\n" not in message
        return message

    return launch


def _never(job):
    pytest.fail("ran")


@pytest.mark.parametrize(
    ("override", "parts"),
    [
        ("robot=jakal", ["robot=jakal: no such option; did you mean jackal?", "conf/robot/ holds: go2, "]),
        ("+robot=jakal", ["did you mean jackal?"]),
        ('robot.name="${x"', ["robot.name is ${x: must be an interpolation with its closing brace"]),
        ("robot=3", ["robot=3: no such option", "turtlebot2"]),
        ("robot=", ["robot=: no such option", "turtlebot2"]),
        ("robot=null", ["robot=null: must be one of go2, "]),
        ("ablation=[none,no_co]", ["ablation=no_co", "did you mean no_c_o?"]),
        ("ablation=xyz", ["ablation=xyz: no such option; conf/ablation/ holds: no_a_close, "]),
        ("ablation=no_memori", ["did you mean no_memory?"]),
        ("tracking=non", ["did you mean none?"]),
        (
            "map=[barn,env1]",
            ["map=[barn,env1]: map takes one option; several are a sweep: -m map=barn,env1"],
        ),
        ("+robot=[go2]", ["robot=[go2]: robot takes one option; "]),
        ("guide=[]", ["guide=[]: guide takes one option; "]),
        ("experiment=[traps,table2]", ["experiment takes one option; "]),
        ("system=lme,dwa", ["system=lme,dwa: several values; add -m to run each of them"]),
        ("ablation=no_c_o,no_c_t", ["or write ablation=[no_c_o,no_c_t] for a list"]),
        ("hydra/launcher=ray", ["hydra/launcher=ray: is not installed; pip install 'hydra-ray-launcher' "]),
        ("hydra/sweeper=optuna", ["is not installed; pip install 'hydra-optuna-sweeper' installs it"]),
        ("search=tpe", ["search is a group of lme train; "]),
        ("figure=maps", ["figure is a group of lme figure; "]),
        ("experiment=x", ["experiment=x: no such option; conf/experiment/ holds:"]),
        (
            "hydra.sweeper.params.seed=1,2",
            ["several values for a key of Hydra's own; must be -m seed=1,2 to sweep it"],
        ),
        ("hydra.verbose=true,false", ["several values for a key of Hydra's own; must be one value"]),
        (
            "ablation=[no_c_o,no_c_t,no_c_o]",
            ["ablation=[no_c_o,no_c_t,no_c_o]: names no_c_o twice; omit one"],
        ),
        (
            "crowd.density=0.1",
            ["crowd.density: no such key; crowd=none has no keys: choose crowd=orca or social_force first"],
        ),
        ("filter.x=1", ["filter.x: no such key; filter=none has no keys: choose filter=stopping first"]),
        ("hydra.job.env_set.x=1", ["hydra.job.env_set.x: no such key; hydra.job.env_set is empty"]),
        ("robots=jackal", ["robots: no such key; did you mean robot? eval holds: ablation, "]),
        ("sed=1", ["sed: no such key; did you mean seed?"]),
        ("+sed=1", ["sed: no such key; did you mean seed?"]),
        ("++sed=1", ["sed: no such key; did you mean seed?"]),
        ("robot.v_mx=1", ["robot.v_mx: no such key; did you mean robot.v_max? robot holds: "]),
        (
            "robot.contact.width=1",
            [
                "robot.contact is null: set all of it, robot.contact={…}; it has the keys radius, length, width"
            ],
        ),
        ("map.start.x=1", ["map.start.x: no such key; map.start is a single value"]),
        ("+map.start.x=1", ["map.start.x: no such key; map.start is a single value"]),
        ("robot.lidar.cloud={a: 1}", ["robot.lidar.cloud is {a: 1}: must be a mapping of height, "]),
        (f"robot.lidar.yaw=1{'0' * 400}", ["robot.lidar.yaw is 1000", ": must be a number"]),
        ("robot.num_beams=9", ["did you mean robot.lidar.num_beams?"]),
        ("robot.lidar.num_beam=9", ["did you mean robot.lidar.num_beams? robot.lidar holds: cloud, fov, "]),
        ("map.subst=all", ["did you mean map.subset?"]),
        ("seed.x=1", ["seed.x: no such key; seed is a single value"]),
        ("guide/x=1", ["guide/x=1: no such group", "robot, map, guide"]),
        ("hydra.foo=1", ["hydra.foo: no such key"]),
        ("hydra/launcher=foo", ["hydra/launcher", "basic"]),
        ("robot={v_mx: 3}", ["robot.v_mx: no such key; did you mean v_max?"]),
        (f"{'x' * 300}=1", ["xxx…: no such key or group"]),
        (f"robot=x/{'x' * 300}", ["xxx: no such option"]),
        ("+guide.nope=3", ["guide.nope: no such key; guide holds: _target_, blocking, "]),
        ("guide.nope.deep=3", ["guide.nope.deep: no such key; guide holds: "]),
        ("guide.candidate=3", ["did you mean guide.candidates? guide holds: "]),
        (
            "robot=/x.yaml",
            ["robot=/x.yaml: no such option; ", "; robot=x, an option of your own, needs --config-dir "],
        ),
        (
            "robot=my/x.yml",
            ["robot=x, an option of your own, needs --config-dir DIR, with the file DIR/robot/x.yaml"],
        ),
        ("robot=my/x", ["with the file DIR/robot/my/x.yaml"]),
        (
            "topics=go2",
            ["topics=go2: no such group; topics is a group of lme live; there are: robot, "],
        ),
        ("+topics=go2", ["+topics=go2: no such group; topics is a group of lme live;"]),
        ("weight_set=skid", ["weight_set=skid: no such group; there are: robot, "]),
        ("~seed", ["~seed: keys cannot be removed"]),
        ("seed=1.5", ["seed is 1.5: must be a whole number"]),
        ("seed=x", ["seed is x: must be a whole number"]),
        ("seed=", ["seed is empty: must be a whole number"]),
        ("robot.v_max=fast", ["robot.v_max is fast: must be a number"]),
        ("robot.lidar.num_beams=1.5", ["robot.lidar.num_beams is 1.5: must be a whole number"]),
        ("robot.footprint=3", ["robot.footprint is 3: must be a mapping of radius, length, width"]),
        ("robot={lidar: {num_beams: x}}", ["robot.lidar.num_beams is x: must be a whole number"]),
        ("ablation.c_o=x", ["ablation.c_o is x: must be a number"]),
        ("seed=${nope}", ["seed", "nope"]),
        ("seed=0,1", ["seed=0,1: several values; add -m", "seed=[0,1]"]),
        ("seed=range(0,3)", ["add -m"]),
        ("robot", ["robot: must be key=value"]),
        ("=3", ["=3: must be key=value; the key is missing"]),
        ("map.worlds=range(5)", ["add -m to run each of them, or write map.worlds=0-4"]),
        ("map.worlds=[range(5)]", ["several values within a list or a mapping; must be single values"]),
        ("map={worlds: range(5)}", ["several values within a list or a mapping"]),
        ("map.worlds=9-0", ["map.worlds has 9-0: the range runs backwards; must be 0-9"]),
        ("map.worlds=[0-9,3]", ["map.worlds is [0-9,3]: lists a world twice"]),
        (
            "map.worlds=first",
            ["map.worlds has 'first': must be numbers and ranges", "such as 0-49 or [0-9,20"],
        ),
        ("map.worlds=0-99999999999", ["map.worlds has 0-99999999999: must be at most 1000000 worlds"]),
        ("map.worlds=[1", ["map.worlds=[1: the value [1 cannot be read", "close every bracket"]),
        ("weights='x", ["weights='x", "quote"]),
        ("weights=publishd", ["weights is 'publishd'", "did you mean published?"]),
        ("robot.v_max=-1", ["robot.v_max is -1: must be greater than 0"]),
        ("robot.lidar.num_beams=0", ["robot.lidar.num_beams is 0: must be greater than 1"]),
        ("robot.collision_radius=0.01", ["robot.collision_radius is 0.01 m", "at least 0.155"]),
        ("--confg-dir=x", ["--confg-dir=x", "--help"]),
        ("--config-dir=nope", ["--config-dir nope: no such directory"]),
        (f"--config-dir={'x' * 5000}", ["xxx: no such directory"]),
        ("--config-name=nope", ["config nope: no nope.yaml"]),
        ("--cfg=x", ["--cfg", "'job'"]),
        ("--resolve", ["--resolve goes with --cfg"]),
    ],
)
def test_a_mistake_on_the_command_line_is_one_line(launch, override, parts):
    message = launch(override)
    for part in parts:
        assert part in message


@pytest.mark.parametrize("words", [["system=dwa_tuned"], ["guide=target", "planner=dwa_tuned"]])
def test_a_planner_that_nothing_says_how_to_search(launch, words):
    message = launch(*words, command="train")
    assert message.startswith("no space/planner/dwa_tuned.yaml, which the chosen options ask for; ")
    assert "conf/space/planner/ holds: apf, dwa, " in message


def test_a_key_within_an_interpolation_that_another_override_puts_there(launch):
    message = launch("robot.footprint=${x.y}", "robot.footprint.width={}")
    assert message == "robot.footprint: Interpolation key 'x.y' not found"


def test_a_group_of_several_commands_names_them_as_a_sentence_does(launch):
    message = launch("executor=serial", command="replay")
    assert "executor is a group of lme eval, lme train, lme learn, lme figure; " in message


def test_a_missing_launcher_is_named_with_the_bounds_of_its_package(launch, monkeypatch):
    monkeypatch.setattr(ConfigStore.instance(), "repo", copy.deepcopy(ConfigStore.instance().repo))
    for name in ("joblib.yaml", "submitit_slurm.yaml"):
        del ConfigStore.instance().repo["hydra"]["launcher"][name]
    assert "pip install 'hydra-joblib-launcher" in launch("hydra/launcher=joblib")
    assert "pip install 'hydra-submitit-launcher>=1.2'" in launch("hydra/launcher=submitit_slurm")


def test_several_options_in_a_sweep(launch):
    assert "map takes one option; " in launch("-m", "map=barn,[env1,env2]")


def test_a_mistake_in_one_job_of_a_sweep(launch):
    assert "robot=nope: no such option" in launch("-m", "robot=jackal,nope")
    assert "seed is x: must be a whole number" in launch("-m", "seed=0,x", "robot=jackal,go2")
    assert "robot.v_max is -1" in launch("-m", "robot.v_max=1,-1")


@pytest.fixture
def own(tmp_path):
    """The user's own config folder, with a robot in it that is Jackal's but for one line."""

    def own(old, new):
        folder = tmp_path / "own" / "robot"
        folder.mkdir(parents=True, exist_ok=True)
        assert old in ROBOT
        (folder / "mine.yaml").write_text(ROBOT.replace(old, new))
        return ("--config-dir", "own", "robot=mine"), f"(in {folder / 'mine.yaml'})"

    return own


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("v_max: 2.0", "v_max: fast", "robot.v_max is fast: must be a number"),
        ("v_max: 2.0", "v_mx: 2.0", "robot.v_mx: no such key; did you mean v_max?"),
        ("v_max: 2.0", "v_max: -2.0", "robot.v_max is -2: must be greater than 0"),
        ("v_max: 2.0", "", "robot.v_max has no value"),
        ("num_beams: 720", "num_beams: 7.5", "robot.lidar.num_beams is 7.5: must be a whole number"),
        ("num_beams: 720", "num_beams: 0", "robot.lidar.num_beams is 0"),
        ("v_max: 2.0", "v_max: 2.0\ncontact: ${oc.env:PATH}", "robot.contact is '"),
        ("v_max: 2.0", "v_max: ${x", "v_max is ${x: must be an interpolation with its closing brace"),
        (
            "num_beams: 720",
            "num_beams: '${oc.env:A'",
            "lidar.num_beams is ${oc.env:A: must be an interpolation",
        ),
        ("v_max: 2.0", 'v_max: 2.0\n"a\\nb": 1', "a b"),
    ],
)
def test_a_mistake_in_an_own_yaml_names_the_file(launch, own, old, new, said):
    words, place = own(old, new)
    message = launch(*words)
    assert said in message
    assert message.endswith(place)


def test_a_value_from_the_command_line_does_not_blame_the_file(launch, own):
    words, _ = own("v_max: 2.0", "v_max: 1.0")
    assert "mine.yaml" not in launch(*words, "robot.v_max=-3")


def test_of_several_files_the_one_with_the_open_interpolation_is_named(launch, own):
    words, place = own("v_max: 2.0", "v_max: ${x.y")
    folder = Path(words[1])
    (folder / "robot" / "another.yaml").write_text(ROBOT.replace("v_max: 2.0", "v_max: ${x.y}"))
    (folder / "robot" / "broken.yaml").write_text("v_max: ${x.y\n- 1\n")
    (folder / "map").mkdir()
    (folder / "map" / "mine.yaml").write_text("defaults: [env1]\nv_max: ${x.z\n")
    assert launch(*words).endswith(place)


def test_broken_yaml_names_file_and_line(launch, own):
    words, _ = own("v_max: 2.0", "v_max: [2.0")
    message = launch(*words)
    assert "own/robot/mine.yaml, line " in message
    assert "not valid YAML" in message


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("0.5", "Invalid loaded object type: float"),
        (ROBOT.replace("name: jackal", 'name: "\\uD800"'), "not valid YAML"),
    ],
)
def test_a_file_that_is_not_a_mapping_or_that_only_one_parser_reads(launch, own, text, said):
    words, _ = own("v_max: 2.0", "v_max: 1.0")
    Path(words[1], "robot", "mine.yaml").write_text(text)
    assert said in launch(*words)


def test_an_unknown_option_names_both_folders(launch, own):
    (flag, folder, _), _ = own("v_max: 2.0", "v_max: 1.0")
    message = launch(flag, folder, "robot=min")
    assert "did you mean mine?" in message
    assert "conf/robot/ and " in message


def test_a_group_of_the_users_own_needs_its_plus(launch, tmp_path):
    (tmp_path / "own" / "colour").mkdir(parents=True)
    (tmp_path / "own" / "colour" / "red.yaml").write_text("# @package _global_\nseed: 7\n")
    message = launch("--config-dir", "own", "colour=red")
    assert message == "colour=red: colour is not in the defaults of eval: add it with +colour=red"


@pytest.fixture(scope="module")
def composer():
    schema.register()
    with Composer("eval") as composer:
        yield composer


@given(text=st.text(st.sampled_from("ab \\'\"[](){},=:$%é"), max_size=12))
def test_a_quoted_text_comes_through_hydras_grammar(composer, text):
    (override,) = composer.parse([f"weights={quoted(text)}"])
    assert override.value() == text
