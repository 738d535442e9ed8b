"""Checks for a display before Qt is loaded, because without a display Qt aborts the process."""

import ctypes
import os
import re
import socket
import sys
from pathlib import Path

from sonarhw.errors import SonarError

_INSTEAD = "`sonarhw demo --headless DIR` works without a window"
_TIMEOUT = 2.0  # s


class NoDisplay(SonarError):
    """There is no display for a window."""


def check_display() -> None:
    """Raise NoDisplay if no window can be opened."""
    if not sys.platform.startswith("linux") or _without_display() or os.environ.get("WAYLAND_DISPLAY"):
        return
    display = os.environ.get("DISPLAY", "")
    if not display:
        raise NoDisplay(f"no display for a window (DISPLAY is not set); {_INSTEAD}")
    if not _answers(display):
        raise NoDisplay(f"no display for a window (no X server answers at {display}); {_INSTEAD}")
    try:
        ctypes.CDLL("libxcb-cursor.so.0")
    except OSError:
        raise NoDisplay(f"Qt needs libxcb-cursor0 for a window: apt-get install libxcb-cursor0; {_INSTEAD}") from None


def _without_display() -> bool:
    return os.environ.get("QT_QPA_PLATFORM", "xcb").split(":")[0] in ("offscreen", "minimal", "vnc", "linuxfb", "eglfs")


def _answers(display: str) -> bool:
    """Return whether an X server listens at `display`; assumed for an unusual format."""
    matched = re.fullmatch(r"(?:unix)?([^:/]*):(\d+)(?:\.\d+)?", display)
    if matched is None:
        return True
    host, number = matched[1], int(matched[2])
    if host:
        return _connects(socket.AF_INET, (host, 6000 + number))
    path = f"/tmp/.X11-unix/X{number}"
    return (Path(path).exists() and _connects(socket.AF_UNIX, path)) or _connects(socket.AF_UNIX, f"\0{path}")


def _connects(family: socket.AddressFamily, address: str | tuple[str, int]) -> bool:
    with socket.socket(family) as probe:
        probe.settimeout(_TIMEOUT)
        try:
            probe.connect(address)
        except OSError:
            return False
    return True
