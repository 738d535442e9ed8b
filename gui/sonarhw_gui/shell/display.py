"""Checks for a display before Qt is loaded, because without one Qt ends the process."""

import ctypes
import os
import re
import socket
import sys
from pathlib import Path

from sonarhw.errors import SonarError

_ELSE = "`sonarhw demo --headless DIR` does the job without a window"
_PATIENCE = 2.0  # s


class NoDisplay(SonarError):
    """There is no display to open a window on."""


def check_display() -> None:
    """Raise NoDisplay, in one line, where no window can be opened."""
    if not sys.platform.startswith("linux") or _without_display() or os.environ.get("WAYLAND_DISPLAY"):
        return
    display = os.environ.get("DISPLAY", "")
    if not display:
        raise NoDisplay(f"there is no display to open a window on (DISPLAY is not set); {_ELSE}")
    if not _answers(display):
        raise NoDisplay(f"there is no display to open a window on (nothing answers at {display}); {_ELSE}")
    try:
        ctypes.CDLL("libxcb-cursor.so.0")
    except OSError:
        raise NoDisplay(f"Qt needs libxcb-cursor0 for a window: apt-get install libxcb-cursor0; {_ELSE}") from None


def _without_display() -> bool:
    return os.environ.get("QT_QPA_PLATFORM", "xcb").split(":")[0] in ("offscreen", "minimal", "vnc", "linuxfb", "eglfs")


def _answers(display: str) -> bool:
    """Whether an X server listens where `display` says; taken for granted where it says something unusual."""
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
        probe.settimeout(_PATIENCE)
        try:
            probe.connect(address)
        except OSError:
            return False
    return True
