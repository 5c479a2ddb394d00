"""A full disk, told in one line."""

from __future__ import annotations

from runners.records.whole_file import DISK_FULL


def disk_full(error: Exception) -> str:
    """What to say of an error where the disk is full; empty for any other error."""
    if not isinstance(error, OSError) or error.errno not in DISK_FULL:
        return ""
    place = f" while writing {error.filename}" if error.filename else ""
    return f"disk full{place}: what is finished is kept; free some space and add resume=true"
