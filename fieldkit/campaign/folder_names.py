"""Names of files and folders in a campaign's folder."""

from __future__ import annotations

import re

from fieldkit.cache import digest

_MAX_NAME_BYTES = 200
_DEVICE = re.compile(r"(con|prn|aux|nul|com[0-9]|lpt[0-9])(\..*)?", re.IGNORECASE)
_UNSAFE = set('/\\:*?"<>|%')


def folder_name(plot: str) -> str:
    """A plot's id as a folder's name: what file systems refuse is written %XX."""
    safe = "".join(f"%{ord(c):02X}" if c in _UNSAFE or ord(c) < 32 else c for c in plot)
    if safe.startswith(".") or safe.endswith("."):
        safe = safe.replace(".", "%2E")
    if _DEVICE.fullmatch(safe):
        safe = f"%{ord(safe[0]):02X}{safe[1:]}"
    encoded = safe.encode()
    if len(encoded) <= _MAX_NAME_BYTES:
        return safe
    return f"{encoded[: _MAX_NAME_BYTES - 20].decode('utf-8', 'ignore')}%{digest(plot)[:16]}"
