"""Reasons outside the program why a file cannot be written or read, each explained in one line."""

from __future__ import annotations

import errno

from runners.records.whole_file import DISK_FULL

_FORBIDDEN = (errno.EROFS, errno.EACCES, errno.EPERM)


def explain_os_error(error: BaseException) -> str:
    """What to say of a full disk, and of a place that may not be used; empty for any other error."""
    if not isinstance(error, OSError):
        return ""
    if error.errno in DISK_FULL:
        place = f" while writing {error.filename}" if error.filename else ""
        return f"disk full{place}: finished work is kept; free some space and add resume=true"
    if error.errno in _FORBIDDEN and error.filename:
        return (
            f"{error.filename}: cannot be used ({error.strerror}): finished work is kept; use another folder"
        )
    return ""
