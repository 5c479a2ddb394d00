"""A MariaDB server of a test's own, on a Unix socket."""

import getpass
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_SERVER = shutil.which("mariadbd") or shutil.which("mariadbd", path="/usr/sbin")
_PROGRAMS = (_SERVER, shutil.which("mariadb-install-db"), shutil.which("mariadb"))


def lacking() -> str:
    """Why no server can be started here; empty if one can."""
    return "" if all(_PROGRAMS) else "MariaDB is not installed"


class Server:
    """A server in a folder."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._process: subprocess.Popen[bytes] | None = None
        self._run("mariadb-install-db", "--no-defaults", f"--user={getpass.getuser()}",
                  f"--datadir={folder}/data", "--auth-root-authentication-method=normal", "--skip-test-db")  # fmt: skip
        self.start()

    def start(self) -> None:
        """Start the server."""
        words = [f"--user={getpass.getuser()}", f"--datadir={self._folder}/data", "--skip-networking"]
        files = [f"--socket={self._folder}/socket", f"--pid-file={self._folder}/pid"]
        with (self._folder / "log").open("a") as log:
            self._process = subprocess.Popen([_SERVER, "--no-defaults", *words, *files], stderr=log)
        end = time.monotonic() + 60
        while not (self._folder / "socket").exists():
            assert time.monotonic() < end, (self._folder / "log").read_text()
            time.sleep(0.1)

    def stop(self) -> None:
        """Stop the server and break all connections."""
        self._process.kill()
        self._process.wait(30)
        (self._folder / "socket").unlink(missing_ok=True)

    def create(self, database: str) -> str:
        """Create an empty database; its URL."""
        self._run("mariadb", "--no-defaults", f"--socket={self._folder}/socket", "--user=root",
                  "--execute", f"create database {database}")  # fmt: skip
        return f"mysql+pymysql://root@localhost/{database}?unix_socket={self._folder}/socket"

    def _run(self, program: str, *words: str) -> None:
        done = subprocess.run([program, *words], stdin=subprocess.DEVNULL, capture_output=True, timeout=120)
        assert done.returncode == 0, (program, words, done.stderr)


@contextmanager
def running() -> Iterator[Server]:
    """A running server; its folder has a short path, because a socket must have one."""
    with tempfile.TemporaryDirectory(prefix="lme-maria-", ignore_cleanup_errors=True) as folder:
        server = Server(Path(folder))
        try:
            yield server
        finally:
            server.stop()
