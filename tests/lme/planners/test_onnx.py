"""Policies in ONNX files: what they see, what their outputs mean, and what is refused."""

from unittest import mock

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.errors import InputError
from lme.planners.onnx import OnnxPolicy
from lme.types import Guidance, Twist
from tests.builders import observation, stage
from tests.networks import onnx_file
from tests.tolerances import KERNEL

pytest.importorskip("onnx")
pytest.importorskip("onnxruntime")
ROBOT = stage(v_max=2.0, omega_max=3.0, alpha_v=100.0, alpha_omega=100.0)  # reaches any command in a period
LEFT = Guidance(np.array([3.0, 4.0]))
BEAMS = ROBOT.lidar.num_beams
SECTORS = np.full(BEAMS, np.inf, np.float32)
SECTORS[:3], SECTORS[-1] = (4.0, 1.0, 2.0), 0.5


class Recorder:
    """A network that keeps what it is given and always answers the same."""

    def __init__(self, answer):
        self._answer, self.given = np.array(answer), []

    def answer(self, parts):
        self.given.append(parts)
        return self._answer


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return str(onnx_file(tmp_path_factory.mktemp("onnx") / "policy.onnx", ("scan", "target", "twist")))


def made(file, answer=(0.5, -0.25), **settings):
    """The planner with a network that answers `answer`, and that network."""
    settings.setdefault("inputs", ["scan", "target", "twist", "limits", "action"])
    network = Recorder(answer)
    with mock.patch("lme.planners.onnx.Network", return_value=network):
        planner = OnnxPolicy(load_settings("planner/onnx", path=file, **settings), ROBOT)
    planner.reset(np.random.default_rng(0))
    return planner, network


def seen(ranges=SECTORS, twist=(0.3, -0.6)):
    return observation(ranges=ranges, twist=Twist(*twist), robot=ROBOT)


def parts(file, ranges=SECTORS, **settings):
    planner, network = made(file, **settings)
    planner.plan(seen(ranges), LEFT)
    return network.given[0]


def test_unscaled_the_parts_are_those_of_the_environments(file):
    given = parts(file)
    assert list(given) == ["scan", "target", "twist", "limits", "action"]
    assert given["scan"] == pytest.approx(np.minimum(SECTORS, ROBOT.lidar.range_max))
    assert given["target"] == pytest.approx([3.0, 4.0])
    assert given["twist"] == pytest.approx([0.3, -0.6])
    assert given["limits"] == pytest.approx([2.0, 3.0, 100.0, 100.0])
    assert given["action"].tolist() == [0.0, 0.0]
    assert {each.dtype for each in given.values()} == {np.dtype(np.float32)}


def test_each_group_of_beams_has_its_nearest_return(file):
    scan = parts(file, scan={"beams": BEAMS // 2})["scan"]
    assert (scan[0], scan[1], scan[-1]) == (1.0, 2.0, 0.5)


def test_groups_that_differ_by_a_beam_are_those_of_the_environments(file):
    pytest.importorskip("gymnasium")
    from lme.gym import flattened

    ranges = np.random.default_rng(0).uniform(0.1, 9.0, BEAMS).astype(np.float32)
    scan = parts(file, ranges, scan={"beams": 72, "clip": 5.0, "scaled": [-1.0, 1.0]})["scan"]
    assert BEAMS % 72
    nothing = np.zeros(2, np.float32)
    np.testing.assert_array_equal(scan, flattened({"scan": ranges, "target": nothing}, nothing, 72)[:72])


def test_ranges_are_cut_off_and_scaled(file):
    scan = parts(file, scan={"clip": 2.0, "scaled": [-1.0, 1.0]})["scan"]
    assert scan[:4] == pytest.approx([1.0, 0.0, 1.0, 1.0])
    assert scan[-1] == pytest.approx(-0.5)


@pytest.mark.parametrize("nothing", [np.full(BEAMS, np.nan, np.float32), np.empty(0, np.float32)])
def test_nan_and_an_empty_scan_are_no_returns(file, nothing):
    assert (parts(file, nothing)["scan"] == ROBOT.lidar.range_max).all()


@pytest.mark.parametrize(
    ("form", "expected"),
    [
        ({"form": "polar"}, [5.0, np.arctan2(4.0, 3.0)]),
        ({"reach": 10.0}, [0.3, 0.4]),
        ({"reach": 2.5}, [0.6, 0.8]),
        ({"form": "polar", "reach": 10.0}, [0.5, np.arctan2(4.0, 3.0) / np.pi]),
        ({"form": "polar", "reach": 2.5}, [1.0, np.arctan2(4.0, 3.0) / np.pi]),
    ],
)
def test_the_target_has_the_form_that_the_policy_knows(file, form, expected):
    assert parts(file, target=form)["target"] == pytest.approx(expected)


def test_the_twist_is_a_share_of_what_becomes_one(file):
    assert parts(file, twist={"v": 0.6, "omega": 3.0})["twist"] == pytest.approx([0.5, -0.2])


def test_outputs_are_shares_of_the_robots_limits_and_seen_at_the_next_step(file):
    planner, network = made(file)
    assert planner.plan(seen(), LEFT) == pytest.approx((1.0, -0.75), abs=KERNEL)
    planner.plan(seen(), LEFT)
    assert network.given[1]["action"] == pytest.approx([0.5, -0.25])
    planner.reset(np.random.default_rng(0))
    planner.plan(seen(), LEFT)
    assert network.given[2]["action"].tolist() == [0.0, 0.0]


def test_outputs_beyond_one_are_cut_off(file):
    assert made(file, (3.0, -4.0))[0].plan(seen(), LEFT) == pytest.approx((2.0, -3.0))
    free = made(file, (0.6, -4.0), action={"v": [-2.0, 2.0], "omega": [-0.5, 0.5], "clip": False})[0]
    assert free.plan(seen(), LEFT) == pytest.approx((1.2, -2.0))


def test_outputs_may_mean_other_velocities(file):
    planner, _ = made(file, (-1.0, 0.0), action={"v": [-1.0, 2.0], "omega": [-2.0, 1.0]})
    assert planner.plan(seen(), LEFT) == pytest.approx((-1.0, -0.5), abs=KERNEL)


def test_a_command_stays_within_reach(file):
    slow = stage(v_max=2.0, omega_max=3.0, alpha_v=1.0, alpha_omega=1.0)
    with mock.patch("lme.planners.onnx.Network", return_value=Recorder((1.0, 1.0))):
        planner = OnnxPolicy(load_settings("planner/onnx", path=file), slow)
    command = planner.plan(observation(ranges=SECTORS, twist=Twist(0.0, 0.0), robot=slow), LEFT)
    assert command == pytest.approx((slow.dt, slow.dt))


def test_a_real_network_answers_the_same_joined_and_by_name(tmp_path):
    """The random weights are the same; the joined input is in the order of `inputs`."""
    commands = []
    for name, given in {"joined": [("x", 4)], "named": [("target", 2), ("twist", 2)]}.items():
        path = onnx_file(tmp_path / f"{name}.onnx", given)
        planner = OnnxPolicy(load_settings("planner/onnx", path=str(path), inputs=["target", "twist"]), ROBOT)
        commands.append(planner.plan(seen(), LEFT))
    assert commands[0] == commands[1] != (0.0, 0.0)


def test_a_network_of_doubles_is_given_doubles(tmp_path):
    import onnx

    path = onnx_file(tmp_path / "double.onnx", [("x", 2)], dtype=onnx.TensorProto.DOUBLE)
    planner = OnnxPolicy(load_settings("planner/onnx", path=str(path), inputs=["target"]), ROBOT)
    assert np.isfinite(planner.plan(seen(), LEFT)).all()


@pytest.mark.parametrize(
    "settings", [{"path": None}, {"path": "missing.onnx"}, {"scan": {"beams": 541}}], ids=str
)
def test_a_mistake_is_named(file, settings, says):
    with says.raises(InputError):
        OnnxPolicy(load_settings("planner/onnx", **{"path": file, **settings}), ROBOT)


def refused(tmp_path, inputs, given, **network):
    path = onnx_file(tmp_path / "policy.onnx", given, **network)
    with pytest.raises(InputError) as caught:
        OnnxPolicy(load_settings("planner/onnx", path=str(path), inputs=inputs), ROBOT)
    return str(caught.value)


def test_a_network_of_another_size_is_refused_with_both(tmp_path, says):
    said = refused(tmp_path, ["scan", "target"], [("x", 76)])
    assert f"input x takes 76 numbers, but inputs and scan make {BEAMS + 2}" in said
    assert f"(scan {BEAMS} + target 2): must be equal" in said
    assert "\n" not in said


def test_a_network_with_another_input_or_output_is_refused(tmp_path, says):
    said = refused(tmp_path, ["scan", "target"], ["scan", ("goal", 2)])
    assert "inputs is ['scan', 'target']: must name all inputs of" in said
    assert "which are scan, goal" in said
    said = refused(tmp_path, ["target"], [("target", 2)], outputs=5)
    says(said)


def test_a_file_that_is_not_onnx_is_refused_in_one_line(tmp_path, says):
    path = tmp_path / "policy.onnx"
    path.write_bytes(b"not a network")
    with pytest.raises(InputError, match="cannot be read as an ONNX file") as caught:
        OnnxPolicy(load_settings("planner/onnx", path=str(path)), ROBOT)
    assert "\n" not in str(caught.value)


@pytest.fixture
def altered(tmp_path):
    """The line about a network of one input of two numbers after `change` has altered it."""
    import onnx

    def said(change, inputs=("target",), data=None):
        path = onnx_file(tmp_path / "policy.onnx", [("x", 2)])
        network = onnx.load(path)
        change(network)
        path.write_bytes(network.SerializeToString())
        if data is not None:
            onnx.save_model(network, path, save_as_external_data=True, location="data", size_threshold=0)
            (tmp_path / "data").write_bytes(data)
        with pytest.raises(InputError) as caught:
            OnnxPolicy(load_settings("planner/onnx", path=str(path), inputs=list(inputs)), ROBOT)
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)
        assert "onnxruntime_src" not in str(caught.value)
        return str(caught.value)

    return said


def test_a_network_for_a_batch_is_refused_with_its_shape(altered, says):
    def batch(network):
        for values in (network.graph.input[0], network.graph.output[0]):
            values.type.tensor_type.shape.dim[0].dim_value = 64

    says(altered(batch))


def test_a_network_of_the_future_is_refused_with_both_versions(altered):
    def ir(network):
        network.ir_version = 99

    def opset(network):
        network.opset_import[0].version = 99

    assert "IR version 99, and onnxruntime" in altered(ir)
    assert "opset 99 of ai.onnx, and onnxruntime" in altered(opset)


def test_a_network_with_parts_that_are_not_there_is_refused(altered):
    def foreign(network):
        network.opset_import.append(__import__("onnx").helper.make_opsetid("mine", 1))
        network.graph.node[0].domain, network.graph.node[0].op_type = "mine", "Foo"

    assert "has no operator mine:Foo" in altered(foreign)
    assert "its weights are in another file: export all into one" in altered(lambda network: None, data=b"x")


def test_a_network_without_an_input_or_with_another_kind_of_output_is_refused(altered, says):
    from onnx import TensorProto, helper

    def sequence(network):
        network.graph.node.append(helper.make_node("SequenceConstruct", ["action"], ["all"]))
        network.graph.output[0].CopyFrom(
            helper.make_tensor_sequence_value_info("all", TensorProto.FLOAT, None)
        )

    def text(network):
        network.graph.node.append(helper.make_node("Cast", ["action"], ["said"], to=TensorProto.STRING))
        network.graph.output[0].CopyFrom(helper.make_tensor_value_info("said", TensorProto.STRING, None))

    def constant(network):
        del network.graph.input[:], network.graph.node[:], network.graph.initializer[:]
        zeros = helper.make_tensor("zeros", TensorProto.FLOAT, (1, 2), [0.0, 0.0])
        network.graph.node.append(helper.make_node("Constant", [], ["action"], value=zeros))

    says(altered(sequence))
    says(altered(text))
    says(altered(constant))


def test_half_a_file_is_refused(tmp_path, says):
    path = onnx_file(tmp_path / "policy.onnx")
    for content in (path.read_bytes()[:-9], b""):
        path.write_bytes(content)
        with pytest.raises(InputError, match="it is damaged, or no ONNX file"):
            OnnxPolicy(load_settings("planner/onnx", path=str(path)), ROBOT)


def test_an_answer_that_is_not_finite_is_refused(file, says):
    with says.raises(InputError):
        made(file, (np.nan, 0.0))[0].plan(seen(), LEFT)


def test_a_scan_with_other_beams_than_the_robots_is_refused(file, says):
    with says.raises(InputError):
        made(file)[0].plan(seen(np.ones(10, np.float32)), LEFT)


def test_without_onnxruntime_a_line_says_how_to_install_it(file, monkeypatch, says):
    monkeypatch.setitem(__import__("sys").modules, "onnxruntime", None)
    with pytest.raises(InputError, match="needs onnxruntime: pip install"):
        OnnxPolicy(load_settings("planner/onnx", path=file), ROBOT)
