"""A Slurm of one node for tests: Debian's daemons, on this machine alone, with their files in one folder."""

import getpass
import os
import shutil
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "srun", "sinfo")
DAEMONS = "/usr/sbin"  # not on the path of every user
HOST = socket.gethostname().partition(".")[0]
CONFIG = """\
ClusterName=test
SlurmctldHost={host}(127.0.0.1)
SlurmUser={user}
SlurmdUser={user}
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
MpiDefault=none
NodeName={host} NodeAddr=127.0.0.1 CPUs=2 RealMemory=1000
PartitionName=debug Nodes={host} Default=YES MaxTime=INFINITE
"""


def lacking() -> str:
    """Why no Slurm can be started here; empty if one can."""
    missing = [name for name in PROGRAMS if _program(name) is None]
    return f"needs Debian's slurm-wlm: {', '.join(missing)} missing" if missing else ""


@contextmanager
def running() -> Iterator[dict[str, str]]:
    """A running Slurm; gives the environment in which its programs find it.

    The folder has a short path, because a socket must have one. Raises RuntimeError where it does not start.
    """
    with tempfile.TemporaryDirectory(prefix="lme-slurm-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        config = _configured(folder)
        daemons = []
        try:
            for program, *words in _daemons(folder, config):
                log = folder / f"{program}.log"
                with log.open("w") as out:
                    command = [_program(program), *words]
                    daemons.append(
                        subprocess.Popen(command, stdout=out, stderr=out, env=_environment(config))
                    )
            _wait_until_idle(_environment(config))
            yield _environment(config)
        finally:
            for daemon in reversed(daemons):
                daemon.terminate()
                daemon.wait(30)


def _configured(folder: Path) -> Path:
    """Write the key and the configuration into the folder; the path of the latter."""
    key, config = folder / "munge.key", folder / "slurm.conf"
    key.touch(mode=0o600)
    key.write_bytes(os.urandom(1024))
    folder.chmod(0o755)  # of munge's socket
    for name in ("state", "spool"):
        (folder / name).mkdir(mode=0o755)
    text = CONFIG.format(host=HOST, user=getpass.getuser(), ports=_free_ports(2), folder=folder)
    config.write_text(text)
    return config


def _daemons(folder: Path, config: Path) -> Iterator[list[str]]:
    munge = [f"--{name}-file={folder}/munge.{name}" for name in ("key", "log", "pid", "seed")]
    yield ["munged", "--foreground", "--force", f"--socket={folder}/munge.socket", *munge]
    yield ["slurmctld", "-D", "-f", str(config)]
    yield ["slurmd", "-D", "-f", str(config), "-N", HOST]


def _environment(config: Path) -> dict[str, str]:
    return {**os.environ, "SLURM_CONF": str(config)}


def _wait_until_idle(environment: dict[str, str]) -> None:
    end = time.monotonic() + 30
    while time.monotonic() < end:
        command = [_program("sinfo"), "-h", "-o", "%T"]
        found = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=60)
        if found.stdout.strip() == "idle":
            return
        time.sleep(0.5)
    raise RuntimeError(f"Slurm did not start: {found.stdout}{found.stderr}")


def _program(name: str) -> str | None:
    return shutil.which(name) or shutil.which(name, path=DAEMONS)


def _free_ports(count: int) -> list[int]:
    sockets = [socket.create_server(("127.0.0.1", 0)) for _ in range(count)]
    ports = [each.getsockname()[1] for each in sockets]
    for each in sockets:
        each.close()
    return ports
