"""What SECURITY.md promises: no reader of data runs code, and the page makes no markup of names."""

import ast
import json
import re
import sys

import pytest

from lme.config.presets import load_parameters
from lme.errors import InputError
from runners.records.episode_record import read_log
from runners.records.launch_record import read_launch
from tests.places import ROOT

SOURCES = sorted(path for room in ("lme", "runners", "integrations") for path in (ROOT / room).rglob("*.py"))
FORBIDDEN = {  # names that run what they are given, however they are called
    "eval", "exec", "compile", "pickle.load", "pickle.loads", "pickle.Unpickler", "marshal.loads", "joblib.load",
    "cloudpickle.load", "os.system", "os.popen", "pd.read_pickle", "shelve.open", "yaml.unsafe_load", "yaml.full_load",
}  # fmt: skip
ALLOWED = {"runners/workers/cluster_worker.py: pickle.loads"}  # what the coordinator of the run sent
SAFE_LOADERS = {
    "_StrictLoader",
    "SafeLoader",
}  # of lme.inputs.guarded_file, as tested below


def calls(path):
    """Every call in a file: its dotted name, and the node."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call):
            yield ast.unparse(node.func), node


def words(node):
    return {word.arg: ast.unparse(word.value) for word in node.keywords}


def fault(name, node):
    """Why a call may run code that it reads; empty if it may not."""
    given = words(node)
    if name in FORBIDDEN:
        return name
    if given.get("shell") == "True" or given.get("allow_pickle", "False") != "False":
        return ast.unparse(node)
    if name == "torch.load" and given.get("weights_only") != "True":
        return "torch.load without weights_only"
    loader = given.get("Loader") or (ast.unparse(node.args[1]) if len(node.args) > 1 else "")
    if name in ("yaml.load", "yaml.compose") and loader not in SAFE_LOADERS:
        return f"{name} with {loader}"
    return ""


def test_no_reader_runs_what_it_reads():
    found = {
        f"{path.relative_to(ROOT)}: {why}"
        for path in SOURCES
        for name, node in calls(path)
        if (why := fault(name, node))
    }
    assert found == ALLOWED


@pytest.mark.parametrize(
    "code",
    ["pickle.load(f)", "np.load(f, allow_pickle=True)", "torch.load(f)", "yaml.load(f, yaml.Loader)", "eval(x)",
     "subprocess.run(x, shell=True)", "torch.load(f, weights_only=False)", "yaml.load(f)"],
)  # fmt: skip
def test_the_check_finds_what_it_looks_for(code):
    node = ast.parse(code, mode="eval").body
    assert fault(ast.unparse(node.func), node)


def test_the_loaders_of_yaml_are_safe():
    import yaml

    from lme.inputs import guarded_file

    for loader in (guarded_file._StrictLoader, guarded_file.SafeLoader):
        with pytest.raises(yaml.constructor.ConstructorError, match="python/object"):
            yaml.load("!!python/object/apply:os.getcwd []", loader)


def test_reading_a_launch_imports_nothing_that_it_names(tmp_path, monkeypatch):
    (tmp_path / "trap_of_a_launch.py").write_text("raise SystemExit('imported')\n")
    monkeypatch.syspath_prepend(tmp_path)
    config = {"guide": {"_target_": "trap_of_a_launch.Guide"}}
    launch = {"command": "eval", "fingerprint": "", "multirun": False, "overrides": [], "configs": [config]}
    (tmp_path / "launch.json").write_text(json.dumps(launch))
    assert read_launch(tmp_path).configs == [config]
    assert "trap_of_a_launch" not in sys.modules


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("parameters: !!python/object/apply:os.getcwd []", "not valid YAML"),
        ("parameters: {d1: os}", "must be a number"),
        (f"parameters: {{d1: 1{'0' * 400}}}", "too large"),
    ],
)
def test_a_weight_file_holds_numbers_only(tmp_path, content, said):
    (tmp_path / "weights.yaml").write_text(content)
    with pytest.raises(InputError, match=said):
        load_parameters(tmp_path / "weights.yaml")


def test_an_append_log_holds_no_objects(tmp_path, says):
    entry = {"record": {"world": 1, "run": 0}, "trajectory": {"x_m": ["|O", "AAAAAAAAAAA="]}}
    (tmp_path / "episodes.jsonl").write_text(json.dumps(entry) + "\n")
    with (
        says.raises(InputError),
        read_log(tmp_path / "episodes.jsonl") as log,
    ):
        list(log.entries())


def test_the_pages_scripts_make_no_markup_and_run_no_text():
    scripts = (ROOT / "runners" / "reports" / "explainer" / "assets").glob("*.js")
    text = "\n".join(path.read_text(encoding="utf-8") for path in scripts)
    assert "textContent" in text
    assert not re.search(
        r"(inner|outer)HTML|insertAdjacentHTML|document\.write|\beval\(|new Function|fetch\(", text
    )


def test_the_places_that_the_document_names_are_there():
    text = (ROOT / "SECURITY.md").read_text(encoding="utf-8")
    named = re.findall(r"`((?:tests|lme|runners)/[\w./]+)`", text)
    assert len(named) > 10
    assert not [path for path in named if not (ROOT / path).exists()]
