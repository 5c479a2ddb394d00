"""The small face of composing: from the words of a command line to its jobs."""

import pytest

from lme.errors import InputError
from runners.config.command_line import compose
from tests.composing import jobs_of


def test_a_command_line_composes_to_one_job(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (job,) = compose("eval", ["map=env1", "+robot=stage", "map.worlds=0-2", "runs=7"])
    assert (job.config.runs, job.config.map["worlds"], job.choices["robot"]) == (7, [0, 1, 2], "stage")
    assert list(tmp_path.iterdir()) == []


def test_every_job_of_a_sweep_in_hydras_order():
    jobs = compose("eval", ["seed=0,1", "--multirun", "robot=jackal,go2"])
    assert [(job.config.seed, job.config.robot.name) for job in jobs] == [
        (0, "jackal"), (0, "go2"), (1, "jackal"), (1, "go2"),
    ]  # fmt: skip


def test_flags_choose_folder_and_config(tmp_path):
    (tmp_path / "map").mkdir()
    (tmp_path / "map" / "few.yaml").write_text("# A few\ndefaults:\n  - barn\n  - _self_\n\nworlds: 0-4\n")
    (job,) = compose("eval", ["--config-dir", str(tmp_path), "map=few"])
    assert job.config.map["worlds"] == [0, 1, 2, 3, 4]
    assert job.folders[1:] == (tmp_path,)
    (other,) = compose("eval", ["--config-name", "figure"])
    assert other.choices["figure"] == "trajectories"


@pytest.mark.parametrize("swept", ["system=lme,lme_plus", "guide=target,lme"])
def test_one_label_for_several_systems_is_refused(swept, says):
    with pytest.raises(InputError) as error:
        compose("eval", ["-m", swept, "system.label=Mine"])
    says(str(error.value))


@pytest.mark.parametrize("swept", ["planner.kp=4,5", "map=barn,env1", "ablation=none,no_c_t"])
def test_one_label_for_a_system_in_several_settings(swept):
    jobs = compose("eval", ["-m", swept, "system=lme", "system.label=Mine"])
    assert [job.config.system.label for job in jobs] == ["Mine", "Mine"]


def test_the_checks_of_the_command_see_every_job_and_the_words_must_agree(says):
    seen = []
    compose("eval", ["-m", "seed=3,4"], lambda job: seen.append(job.config.seed))
    assert seen == [3, 4]

    def refuse(job):
        raise InputError("seed is 3: must be another")

    with says.raises(InputError, match="seed.*3"):
        compose("eval", ["seed=3"], refuse)
    with says.raises(InputError):
        compose("eval", ["runs=1", "runs=2"])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("name: &x [*x]\n", r"alias \*x contains itself"),
        (
            "0: &0 [a, b, c]\n"
            + "".join(f"{k + 1}: &{k + 1} {[f'*{k}'] * 9}\n".replace("'", "") for k in range(8)),
            "repeat more than",
        ),
        ('{"name": ' + "[" * 50_000, "more than 100 nested values"),
    ],
)
def test_an_option_that_hydra_would_read_without_end_is_refused(tmp_path, text, words):
    (tmp_path / "robot").mkdir()
    (tmp_path / "robot" / "mine.yaml").write_text(text)
    with pytest.raises(InputError, match=rf"robot/mine\.yaml: not valid YAML \(.*{words}"):
        compose("eval", ["--config-dir", str(tmp_path), "robot=mine"])


def test_a_users_file_for_a_shipped_class_may_leave_keys_out(tmp_path):
    (tmp_path / "planner").mkdir()
    text = "# Dwa that keeps away\n_target_: lme.planners.dwa.Dwa\nmargin: 0.3\n"
    (tmp_path / "planner" / "mine.yaml").write_text(text)
    with jobs_of(config_dir=tmp_path) as job:
        assert job("planner=mine").config.planner == {**job("planner=dwa").config.planner, "margin": 0.3}
        assert job("planner=mine").changes == {}
