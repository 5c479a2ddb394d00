"""A file is there as a whole or not at all, whatever happens to its writer."""

import os
import signal
import subprocess
import sys
import textwrap
import threading
from pathlib import Path

import pytest

from lme.errors import InputError
from runners.records.atomic_write import output_file, output_path, replacing, write_atomically
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
    from runners.records.atomic_write import replacing
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


def write_output(path, text="new"):
    with output_file(path) as draft:
        draft.write_text(text)


@pytest.mark.parametrize("there", [True, False])
def test_a_link_that_the_user_names_stays_and_its_target_is_written(tmp_path, there):
    target, link, second = tmp_path / "far" / "table.csv", tmp_path / "near.csv", tmp_path / "second.csv"
    target.parent.mkdir()
    if there:
        target.write_text("before")
    link.symlink_to("far/table.csv")
    second.symlink_to(link)
    write_output(second)
    assert second.is_symlink()
    assert link.is_symlink()
    assert target.read_text() == "new"
    assert list(target.parent.iterdir()) == [target]


def test_a_link_in_a_run_does_not_lead_out_of_it(tmp_path):
    """Somebody else may have made the run."""
    (tmp_path / "mine").write_text("mine")
    (tmp_path / "table.md").symlink_to("mine")
    write_atomically(tmp_path / "table.md", "new")
    assert not (tmp_path / "table.md").is_symlink()
    assert (tmp_path / "mine").read_text() == "mine"


def test_a_replaced_file_keeps_its_permissions(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text("before")
    path.chmod(0o600)
    (tmp_path / "link.csv").symlink_to(path)
    write_output(tmp_path / "link.csv")
    assert (path.read_text(), path.stat().st_mode & 0o777) == ("new", 0o600)


def test_a_pipe_stays_one_and_gets_the_content(tmp_path):
    pipe, received = tmp_path / "pipe.csv", []
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: received.append(pipe.read_text()))
    reader.start()
    write_output(pipe)
    reader.join()
    assert received == ["new"]
    assert pipe.is_fifo()
    assert list(tmp_path.iterdir()) == [pipe]


@pytest.mark.parametrize("name", ["/dev/fd/{}", "/proc/self/fd/{}", "link"])
def test_an_open_file_of_this_process_is_written_from_where_it_stands(tmp_path, name):
    """As `lme export RUN --output /dev/stdout >> FILE` does."""
    path = tmp_path / "log"
    with path.open("a") as log:
        log.write("before, ")
        log.flush()
        (tmp_path / "link").symlink_to(f"/dev/fd/{log.fileno()}")
        write_output(tmp_path / name.format(log.fileno()))
        log.write(", after")
    assert path.read_text() == "before, new, after"


def test_a_device_stays_one():
    write_output(Path(os.devnull))
    assert Path(os.devnull).is_char_device()


def test_nothing_is_written_to_a_pipe_if_the_writer_fails(tmp_path):
    def fail():
        with output_file(tmp_path / "pipe") as draft:
            draft.write_text("half")
            raise KeyboardInterrupt

    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(KeyboardInterrupt):  # and it does not wait for a reader
        fail()


@pytest.mark.parametrize(
    ("name", "error"),
    [
        ("folder", IsADirectoryError),
        (".", IsADirectoryError),
        ("loop", OSError),
        ("missing/table.md", FileNotFoundError),
        ("lost", FileNotFoundError),
        ("/dev/full", OSError),
    ],
)
def test_an_error_names_the_output(tmp_path, name, error):
    (tmp_path / "folder").mkdir()
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "lost").symlink_to("nowhere/table.md")
    with pytest.raises(error) as caught:
        write_output(tmp_path / name)
    assert caught.value.filename in (str(tmp_path / name), None)
    assert caught.value.strerror


def test_an_output_of_several_parts_must_be_a_file(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "link").symlink_to("page.html")
    assert output_path(tmp_path / "link", "--output") == tmp_path / "page.html"
    assert output_path(tmp_path / "page.html", "--output") == tmp_path / "page.html"
    for name, said in (("pipe", "is a pipe or a device: must be a file"), ("loop", "cannot be written")):
        with pytest.raises(InputError, match=f"^--output .*{name}: {said}"):
            output_path(tmp_path / name, "--output")


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write every file")
def test_a_read_only_file_is_not_replaced(tmp_path):
    (tmp_path / "table.csv").write_text("before")
    (tmp_path / "table.csv").chmod(0o444)
    with pytest.raises(PermissionError):
        write_output(tmp_path / "table.csv")
