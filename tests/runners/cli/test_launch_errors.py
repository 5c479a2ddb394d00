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
    "override",
    [
        "robot=jakal",
        "+robot=jakal",
        'robot.name="${x"',
        "robot=3",
        "robot=",
        "robot=null",
        "ablation=[none,no_co]",
        "ablation=xyz",
        "ablation=no_memori",
        "tracking=non",
        "map=[barn,env1]",
        "+robot=[go2]",
        "guide=[]",
        "experiment=[traps,table2]",
        "system=lme,dwa",
        "ablation=no_c_o,no_c_t",
        "hydra/launcher=ray",
        "hydra/sweeper=optuna",
        "search=tpe",
        "figure=maps",
        "experiment=x",
        "hydra.sweeper.params.seed=1,2",
        "hydra.verbose=true,false",
        "ablation=[no_c_o,no_c_t,no_c_o]",
        "crowd.density=0.1",
        "filter.x=1",
        "hydra.job.env_set.x=1",
        "robots=jackal",
        "sed=1",
        "+sed=1",
        "++sed=1",
        "robot.v_mx=1",
        "robot.drivetrain.contact.width=-1",
        "map.start.x=1",
        "+map.start.x=1",
        "robot.lidar.cloud={a: 1}",
        pytest.param(f"robot.lidar.yaw=1{'0' * 400}", id="robot.lidar.yaw=1000..."),
        "robot.num_beams=9",
        "robot.lidar.num_beam=9",
        "map.subst=all",
        "seed.x=1",
        "guide/x=1",
        "hydra.foo=1",
        "hydra/launcher=foo",
        "robot={v_mx: 3}",
        pytest.param(f"{'x' * 300}=1", id="xxx…=1"),
        pytest.param(f"robot=x/{'x' * 300}", id="robot=x/xxx..."),
        "+guide.nope=3",
        "guide.nope.deep=3",
        "guide.candidate=3",
        "robot=/x.yaml",
        "robot=my/x.yml",
        "robot=my/x",
        "topics=go2",
        "+topics=go2",
        "weight_set=skid",
        "~seed",
        "seed=1.5",
        "seed=x",
        "seed=",
        "robot.v_max=fast",
        "robot.lidar.num_beams=1.5",
        "robot.footprint=3",
        "robot={lidar: {num_beams: x}}",
        "ablation.c_o=x",
        "seed=${nope}",
        "seed=0,1",
        "seed=range(0,3)",
        "robot",
        "=3",
        "map.worlds=range(5)",
        "map.worlds=[range(5)]",
        "map={worlds: range(5)}",
        "map.worlds=9-0",
        "map.worlds=[0-9,3]",
        "map.worlds=first",
        "map.worlds=0-99999999999",
        "map.worlds=[1",
        "weights='x",
        "weights=publishd",
        "robot.v_max=-1",
        "robot.lidar.num_beams=0",
        "robot.collision_radius=0.01",
        "--confg-dir=x",
        "--config-dir=nope",
        pytest.param(f"--config-dir={'x' * 5000}", id="--config-dir=xxx..."),
        "--config-name=nope",
        "--resolve",
    ],
)
def test_a_mistake_on_the_command_line_is_one_line(launch, override, says):
    says(launch(override).replace("x" * 5000, "xxx..."))


def test_a_choice_that_argparse_refuses_is_one_line(launch):
    assert "--cfg" in launch("--cfg=x")


@pytest.mark.parametrize("words", [["system=dwa_tuned"], ["guide=target", "planner=dwa_tuned"]])
def test_a_planner_that_nothing_says_how_to_search(launch, words, says):
    says(launch(*words, command="train"))


def test_a_key_within_an_interpolation_that_another_override_puts_there(launch, says):
    says(launch("robot.footprint=${x.y}", "robot.footprint.width={}"))


def test_a_group_of_several_commands_names_them_as_a_sentence_does(launch, says):
    says(launch("executor=serial", command="replay"))


def test_a_missing_launcher_is_named_with_the_bounds_of_its_package(launch, monkeypatch):
    monkeypatch.setattr(ConfigStore.instance(), "repo", copy.deepcopy(ConfigStore.instance().repo))
    for name in ("joblib.yaml", "submitit_slurm.yaml"):
        del ConfigStore.instance().repo["hydra"]["launcher"][name]
    assert "pip install 'hydra-joblib-launcher" in launch("hydra/launcher=joblib")
    assert "pip install 'hydra-submitit-launcher>=1.2'" in launch("hydra/launcher=submitit_slurm")


def test_several_options_in_a_sweep(launch, says):
    says(launch("-m", "map=barn,[env1,env2]"))


@pytest.mark.parametrize(
    "words", [["-m", "sim.latency=interval(0,0.1)"], ["seed=interval(1,2)"]], ids=" ".join
)
def test_an_interval_has_no_values_to_sweep(launch, words, says):
    says(launch(*words))


def test_a_glob_that_matches_no_option(launch, says):
    says(launch("-m", "robot=glob(_*)"))


def test_a_mistake_in_one_job_of_a_sweep(launch, says):
    says(launch("-m", "robot=jackal,nope"))
    says(launch("-m", "seed=0,x", "robot=jackal,go2"))
    assert "robot.v_max is -1" in launch("-m", "robot.v_max=1,-1")


@pytest.fixture
def own(tmp_path):
    """The user's own config folder, with a robot in it that is Jackal's but for one line."""

    def own(old, new):
        folder = tmp_path / "own" / "robot"
        folder.mkdir(parents=True, exist_ok=True)
        assert old in ROBOT
        (folder / "mine.yaml").write_text(ROBOT.replace(old, new, 1))
        return ("--config-dir", "own", "robot=mine"), f"(in {folder / 'mine.yaml'})"

    return own


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("v_max: 2.0", "v_max: fast"),
        ("v_max: 2.0", "v_mx: 2.0"),
        ("v_max: 2.0", "v_max: -2.0"),
        ("v_max: 2.0", ""),
        ("num_beams: 720", "num_beams: 7.5"),
        ("num_beams: 720", "num_beams: 0"),
        ("v_max: 2.0", "v_max: 2.0\nresponse: ${oc.env:PATH}"),
        ("v_max: 2.0", "v_max: ${x"),
        ("num_beams: 720", "num_beams: '${oc.env:A'"),
        ("v_max: 2.0", 'v_max: 2.0\n"a\\nb": 1'),
    ],
)
def test_a_mistake_in_an_own_yaml_names_the_file(launch, own, old, new, monkeypatch, says):
    monkeypatch.setenv("PATH", "/bin")
    words, place = own(old, new)
    message = launch(*words)
    says(message)
    assert message.endswith(place)


def test_a_value_from_the_command_line_does_not_blame_the_file(launch, own):
    words, _ = own("v_max: 2.0", "v_max: 1.0")
    assert "mine.yaml" not in launch(*words, "robot.v_max=-3")


def test_a_bound_from_the_command_line_does_not_blame_the_file(launch, own, says):
    words, _ = own("range_max: 30.0", "range_max: 12.0")
    says(launch(*words, "robot.lidar.range_min=20"))
    words, place = own("range_max: 30.0", "range_max: 0.01")
    assert launch(*words, "robot.lidar.num_beams=90").endswith(place)


def test_of_several_files_the_one_with_the_open_interpolation_is_named(launch, own):
    words, place = own("v_max: 2.0", "v_max: ${x.y")
    folder = Path(words[1])
    (folder / "robot" / "another.yaml").write_text(ROBOT.replace("v_max: 2.0", "v_max: ${x.y}", 1))
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
    "text",
    [
        "0.5",
        "- 1",
        "defaults: [mine, _self_]",  # inherits itself
        ROBOT.replace("name: jackal", 'name: "\\uD800"'),
    ],
)
def test_a_file_that_is_not_a_mapping_or_that_only_one_parser_reads(launch, own, text, says):
    words, _ = own("v_max: 2.0", "v_max: 1.0")
    Path(words[1], "robot", "mine.yaml").write_text(text)
    says(launch(*words))


def test_an_unknown_option_names_both_folders(launch, own, says):
    (flag, folder, _), _ = own("v_max: 2.0", "v_max: 1.0")
    message = launch(flag, folder, "robot=min")
    says(message)
    assert "conf/robot/ and " in message


def test_a_group_of_the_users_own_needs_its_plus(launch, tmp_path, says):
    (tmp_path / "own" / "colour").mkdir(parents=True)
    (tmp_path / "own" / "colour" / "red.yaml").write_text("# @package _global_\nseed: 7\n")
    says(launch("--config-dir", "own", "colour=red"))


@pytest.fixture(scope="module")
def composer():
    schema.register()
    with Composer("eval") as composer:
        yield composer


@given(text=st.text(st.sampled_from("ab \\'\"[](){},=:$%é"), max_size=12))
def test_a_quoted_text_comes_through_hydras_grammar(composer, text):
    (override,) = composer.parse([f"weights={quoted(text)}"])
    assert override.value() == text
