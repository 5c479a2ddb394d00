"""What is said where an optional package is missing."""

import re
import sys

from lme.config.presets import load_settings
from lme.errors import InputError
from runners.recordings import bags, figures
from tests.lme.test_requirements import OPTIONAL
from tests.places import ROOT

SOURCES = [
    path.read_text(encoding="utf-8") for room in ("lme", "runners") for path in (ROOT / room).rglob("*.py")
]
PAGES = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "examples").glob("*")]


def test_every_hint_in_the_code_is_of_an_optional_package():
    calls = [call for text in SOURCES for call in re.findall(r"\binstall\(([\"'][^()]+)\)", text)]
    hinted = {name for call in calls for name in re.findall(r"[\w-]+", call)}
    known = {
        "rosbags",
        "rerun-sdk",
        "imageio-ffmpeg",
        "distributed",
        "torch",
        "gymnasium",
        "onnx",
        "onnxruntime",
    }
    assert known <= hinted <= set(OPTIONAL)


def test_no_command_installs_lme_from_an_index():
    """None has it, and `lme` there is another project. `./lme` is the folder."""
    texts = {str(path): path.read_text(encoding="utf-8") for path in PAGES if path.is_file()}
    texts |= {text.partition("\n")[0]: text for text in SOURCES}
    assert not [
        name
        for name, text in texts.items()
        if re.search(r"install ['\"]?lme\b|(?<!\./)\blme(-nav)?\[\w+\]", text)
    ]


def test_a_replay_without_rosbags_says_what_to_install(tmp_path, monkeypatch, says):
    (tmp_path / "metadata.yaml").write_text("storage_identifier: mcap\n")
    monkeypatch.setitem(sys.modules, "rosbags.highlevel", None)
    with says.raises(InputError):
        bags.Bag(tmp_path).__enter__()


def test_a_rerun_file_without_its_package_says_what_to_install(monkeypatch, says):
    monkeypatch.setitem(sys.modules, "rerun", None)
    with says.raises(InputError):
        figures.check_rerun()


def test_a_cluster_without_its_package_says_what_to_install(monkeypatch, says):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with says.raises(InputError):
        load_settings("executor/dask")
