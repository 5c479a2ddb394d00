"""A PostgreSQL server of a test's own, on a Unix socket."""

import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

BINARIES = max(Path("/usr/lib/postgresql").glob("*/bin/pg_ctl"), default=Path("/nowhere/pg_ctl")).parent
# The password of guest is "right"; the superuser needs none.
_ACCESS = "local all guest scram-sha-256\nlocal all all trust\n"
_SETTINGS = "fsync = off\nlisten_addresses = ''\n"


def lacking() -> str:
    """Why no server can be started here; empty if one can."""
    if not (BINARIES / "initdb").is_file():
        return "PostgreSQL is not installed"
    return "" if os.getuid() or shutil.which("runuser") else "PostgreSQL refuses to run as root"


class Server:
    """A server in a folder, which belongs to the user who runs it: root may not."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._as = [] if os.getuid() else ["runuser", "-u", "postgres", "--"]
        if self._as:
            shutil.chown(folder, "postgres")
        self._run("initdb", "--pgdata", f"{folder}/data", "--username", "me", "--auth", "trust", "--no-sync")
        (folder / "data/pg_hba.conf").write_text(_ACCESS)
        with (folder / "data/postgresql.conf").open("a") as file:
            file.write(f"{_SETTINGS}unix_socket_directories = '{folder}'\n")
        self.start()
        self._run(
            "psql",
            "-qh",
            str(folder),
            "-U",
            "me",
            "-c",
            "create role guest login password 'right'",
            "postgres",
        )

    def start(self) -> None:
        """Start the server."""
        self._run(
            "pg_ctl", "start", "--wait", "--pgdata", f"{self.folder}/data", "--log", f"{self.folder}/log"
        )

    def stop(self) -> None:
        """Stop the server and break all connections."""
        self._run("pg_ctl", "stop", "--mode", "immediate", "--pgdata", f"{self.folder}/data")

    def url(self, database: str = "postgres", account: str = "me") -> str:
        """A storage URL of lme."""
        return f"postgresql://{account}@/{database}?host={self.folder}"

    def create(self, database: str) -> str:
        """Create an empty database; its URL."""
        self._run("createdb", "-h", str(self.folder), "-U", "me", database)
        return self.url(database)

    def _run(self, program: str, *words: str) -> None:
        done = subprocess.run(
            [*self._as, BINARIES / program, *words], cwd=self.folder, stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, timeout=60,
        )  # fmt: skip
        assert done.returncode == 0, (program, words)


@contextmanager
def running() -> Iterator[Server]:
    """A running server; its folder has a short path, because a socket must have one."""
    with tempfile.TemporaryDirectory(prefix="lme-pg-", ignore_cleanup_errors=True) as folder:
        server = Server(Path(folder))
        try:
            yield server
        finally:
            server.stop()
