"""A Redis server of a test's own, on a Unix socket."""

import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


def lacking() -> str:
    """Why no server can be started here; empty if one can."""
    return "" if shutil.which("redis-server") else "Redis is not installed"


@contextmanager
def running() -> Iterator[str]:
    """A running server; gives its URL."""
    with tempfile.TemporaryDirectory(prefix="lme-redis-", ignore_cleanup_errors=True) as folder:
        place = Path(folder, "socket")
        words = ["--port", "0", "--unixsocket", str(place), "--save", "", "--dir", folder]
        server = subprocess.Popen(["redis-server", *words], stdout=subprocess.DEVNULL)
        try:
            end = time.monotonic() + 30
            while not place.exists():
                assert time.monotonic() < end, "redis-server does not start"
                time.sleep(0.05)
            yield f"unix://{place}?db=0"
        finally:
            server.terminate()
            server.wait(30)
