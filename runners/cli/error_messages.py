"""One-line messages for causes outside the program: files that cannot be used, and packages that are not installed."""

from __future__ import annotations

import errno
from pathlib import Path

from runners.records.atomic_write import what_is_full

_NO_TEMPORARY = "No usable temporary directory"  # the message of Python's tempfile
_FORBIDDEN = (errno.EROFS, errno.EACCES, errno.EPERM)
# Packages that `pip install ./lme`, the robots' installation, leaves out, by the module that is imported.
PACKAGES = {
    "hydra": "hydra-core",
    "jinja2": "jinja2",
    "matplotlib": "matplotlib",
    "mlflow": "mlflow",
    "onnx": "onnx",
    "onnxruntime": "onnxruntime",
    "optuna": "optuna",
    "packaging": "packaging",
    "pandas": "pandas",
    "pyarrow": "pyarrow",
    "rich": "rich",
}


def explain_os_error(error: BaseException) -> str:
    """Return the message for a full disk, for temporary folders, for a deleted folder, or for a forbidden path.

    Empty for any other error.
    """
    if not isinstance(error, OSError):
        return ""
    # Full disks and quotas first: they can happen to any file.
    full_disk = what_is_full(error, error.filename or "a file")
    if full_disk:
        return f"{full_disk}: finished work is kept; free some space and add resume=true"
    if error.errno == errno.ENOENT and _NO_TEMPORARY in str(error.strerror):
        directories = str(error.strerror).partition("[")[2].rstrip("]")
        return (
            f"no temporary file can be written in {directories}: free some space there, set TMPDIR to "
            "a folder that can be written, or raise ulimit -f"
        )
    if error.errno == errno.ENOENT and error.filename and not Path(str(error.filename)).parent.exists():
        return f"{error.filename}: its folder is gone: it was deleted while lme was using it; start again"
    if error.errno in _FORBIDDEN and error.filename:
        return (
            f"{error.filename}: cannot be used ({error.strerror}): finished work is kept; use another folder"
        )
    return ""


def explain_missing(error: ModuleNotFoundError, command: str) -> str:
    """Return what is missing and how to install it; empty for a module that every installation has, or for none."""
    package = PACKAGES.get((error.name or "").partition(".")[0])
    if package is None:
        return ""
    install = "pip install './lme[live]'" if command == "live" else "pip install --editable ."
    return f"needs {package}, which is not installed; {install} in a checkout of lme installs what lme {command} needs"
