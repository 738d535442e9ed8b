"""Checks for Qt and a display before Qt is loaded, because without a display Qt aborts the process."""

import ctypes
import importlib.util
import os
import re
import socket
import sys
from pathlib import Path

from sonarhw.errors import MissingExtra, SonarError

DEMO = "`sonarhw demo --headless DIR` works without a window"
_TIMEOUT = 2.0  # s


class NoDisplay(SonarError):
    """There is no display for a window."""


def check_display(instead: str = DEMO) -> None:
    """Raise NoDisplay or MissingExtra if no window can be opened. `instead` states what works without a window."""
    if sys.platform.startswith("linux") and not _without_display() and not os.environ.get("WAYLAND_DISPLAY"):
        _check_x_server(instead)
    for package in ("PySide6", "pyqtgraph"):
        if importlib.util.find_spec(package) is None:
            raise MissingExtra(f"the window needs {package}", "gui")


def _check_x_server(instead: str) -> None:
    display = os.environ.get("DISPLAY", "")
    if not display:
        raise NoDisplay(f"no display for a window (DISPLAY is not set); {instead}")
    if not _answers(display):
        raise NoDisplay(f"no display for a window (no X server answers at {display}); {instead}")
    try:
        ctypes.CDLL("libxcb-cursor.so.0")
    except OSError:
        raise NoDisplay(f"Qt needs libxcb-cursor0 for a window: apt-get install libxcb-cursor0; {instead}") from None


def _without_display() -> bool:
    return os.environ.get("QT_QPA_PLATFORM", "xcb").split(":")[0] in ("offscreen", "minimal", "vnc", "linuxfb", "eglfs")


def _answers(display: str) -> bool:
    """Return whether an X server listens at `display`; assumed for an unusual format."""
    matched = re.fullmatch(r"(?:unix)?([^:/]*):(\d+)(?:\.\d+)?", display)
    if matched is None:
        return True
    host, number = matched[1], int(matched[2])
    if host or sys.platform == "win32":
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
