"""A file is there as a whole or not at all, whatever happens to its writer."""

import os
import signal
import subprocess
import sys
import textwrap

import pytest

from runners.records.whole_file import replacing, write_atomically
from tests.places import ROOT


def test_a_file_takes_the_place_of_the_old_one_and_old_drafts_of_other_machines_go(tmp_path):
    names = ("page.html", ".page.html.other.1.new.html", ".page.html.other.2.new.html")
    path, old, young = (tmp_path / name for name in names)
    for file in (path, old, young):
        file.write_text("before")
    os.utime(old, (0.0, 0.0))  # its writer was killed; the other one may be at work
    write_atomically(path, "whole")
    assert path.read_text() == "whole"
    assert sorted(tmp_path.iterdir()) == [young, path]


def test_the_draft_has_the_suffix_of_the_file(tmp_path):
    with replacing(tmp_path / "film.gif") as draft:
        draft.write_bytes(b"")
    assert draft.suffix == ".gif"
    assert draft.parent == tmp_path


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_the_old_file_stays_if_the_writer_fails(tmp_path, error):
    path = tmp_path / "table.md"
    path.write_text("before")

    def fail():
        with replacing(path) as draft:
            draft.write_text("half")
            raise error

    with pytest.raises(error):
        fail()
    assert path.read_text() == "before"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("place", ["missing/table.md", "file/table.md"])
def test_an_error_names_the_file_and_not_its_draft(tmp_path, place):
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match=r"table\.md") as caught:
        write_atomically(tmp_path / place, "text")
    assert caught.value.filename == str(tmp_path / place)
    assert "new" not in str(caught.value)
    assert str(caught.value).endswith("table.md'")


def test_permissions_are_those_of_any_new_file(tmp_path):
    (tmp_path / "usual").write_text("")
    write_atomically(tmp_path / "whole", "")
    assert (tmp_path / "whole").stat().st_mode == (tmp_path / "usual").stat().st_mode


def test_the_draft_of_a_process_at_work_stays(tmp_path):
    path = tmp_path / "table.md"
    with replacing(path) as ours:
        ours.write_text("half")
    for process in (os.getppid(), 1):  # one of ours and one of the system's
        draft = ours.with_name(ours.name.replace(f".{os.getpid()}.", f".{process}."))
        draft.write_text("half")
    write_atomically(path, "whole")
    assert len(list(tmp_path.iterdir())) == 3


KILLED = """
    import os, signal, sys
    from pathlib import Path
    from runners.records.whole_file import replacing
    with replacing(Path(sys.argv[1])) as draft, draft.open("w") as file:
        file.write("half")
        file.flush()
        os.kill(os.getpid(), signal.SIGKILL)
"""


def test_a_killed_writer_leaves_the_old_file(tmp_path):
    path = tmp_path / "table.md"
    path.write_text("before")
    command = [sys.executable, "-c", textwrap.dedent(KILLED), str(path)]
    assert subprocess.run(command, cwd=ROOT).returncode == -signal.SIGKILL
    assert path.read_text() == "before"
    assert len(list(tmp_path.iterdir())) == 2
    write_atomically(path, "whole")
    assert list(tmp_path.iterdir()) == [path]
