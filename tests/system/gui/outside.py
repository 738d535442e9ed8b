"""Drive `sonarhw gui` from outside: a separate process, controlled by xdotool and observed on the screen.

Tests read its window title, colours on the screen, text selected with the mouse, and the files it writes.
"""

import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from PySide6.QtGui import QClipboard, QColor, QGuiApplication, QImage
from scipy.ndimage import binary_erosion, center_of_mass, label
from sonarhw_gui.model.look import DARK, LIGHT, Palette

from tests.hang_guard import HANG

Pixel = tuple[int, int]
Seen = TypeVar("Seen")
_PAUSE = 0.05
_ABOVE_THE_PLAN = 90  # pixels of menus, tools and legend
_SENTENCE = 14  # pixels from the top of the card below the plan to the middle of its first line
_PLAN_SHARE = 0.5  # share of the window's width
_INSIDE_A_MARK = np.ones((5, 5))
_DIAMOND = np.add.outer(abs(np.arange(-4, 5)), abs(np.arange(-4, 5))) <= 4
_AROUND = (-9, 0), (-6, 6), (0, 9), (6, 6), (9, 0), (6, -6), (0, -9), (-6, -6)
_IN_A_VIEW = 34  # pixels from the left, right of the tools


def awaited(observe: Callable[[], Seen], what: str) -> Seen:
    """Call `observe` until its result is true, and return the result."""
    deadline = time.monotonic() + HANG
    while not (seen := observe()):
        assert time.monotonic() < deadline, f"not seen: {what}"
        time.sleep(_PAUSE)
    return seen


class Outside:
    """A process of `sonarhw gui` with its own data folder; killed if a test leaves it running."""

    def __init__(self, data: Path) -> None:
        command = [sys.executable, "-c", "from sonarhw_cli.entry import main; main()", "gui"]
        environment = {**os.environ, "XDG_DATA_HOME": str(data), "XDG_CONFIG_HOME": str(data), "HOME": str(data)}
        self._process = subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True)
        self._recordings = data / "sonarhw" / "recordings"
        self._window = ""

    def __enter__(self) -> "Outside":
        self._window = awaited(self._find, "a window")
        _xdotool("windowfocus", "--sync", self._window)
        return self

    def __exit__(self, *_: object) -> None:
        if self._process.poll() is None:
            self._process.kill()
            self._process.communicate()

    def _find(self) -> str:
        assert self._process.poll() is None, self._process.communicate()[1]
        visible = ["--all", "--onlyvisible", "--pid", str(self._process.pid), "--name", "^sonarhw — "]
        return subprocess.run(
            ["xdotool", "search", *visible], capture_output=True, text=True, timeout=HANG
        ).stdout.strip()

    def ended(self) -> tuple[int, str]:
        """Wait for the end; return the exit status and standard error."""
        _, complaints = self._process.communicate(timeout=HANG)
        return self._process.returncode, complaints

    @property
    def title(self) -> str:
        """The title of the window."""
        return _xdotool("getwindowname", self._window).removeprefix("sonarhw — ")

    @property
    def recordings(self) -> list[Path]:
        """The logs in its folder, sorted by name."""
        return sorted(self._recordings.glob("*.mcap"))

    def key(self, *keys: str) -> None:
        """Press keys in sequence."""
        _xdotool("key", "--delay", "40", *keys)

    def click(self, at: Pixel) -> None:
        """Click a pixel of the window."""
        _xdotool(*self._to(at), "click", "1")

    def drag(self, start: Pixel, end: Pixel, let_go: bool = True) -> None:
        """Drag from one pixel of the window to another."""
        way = np.round(np.linspace(start, end, 6)).astype(int)
        # with pauses, because the window merges moves that arrive together
        moves = [part for at in way[1:] for part in (*self._to(at), "sleep", "0.03")]
        _xdotool(*self._to(start), "mousedown", "1", *moves, *(["mouseup", "1"] if let_go else []))

    def let_go(self) -> None:
        """Release the mouse button."""
        _xdotool("mouseup", "1")

    def _to(self, at: Pixel) -> list[str]:
        return ["mousemove", "--window", self._window, *map(str, at)]

    def sentence(self) -> str:
        """Return the first line of the card below the plan, selected with the mouse."""
        return awaited(self._selected_text, "a sentence that stays long enough to be selected")

    def _selected_text(self) -> str:
        clipboard, top = QGuiApplication.clipboard(), self._end_of_views()
        clipboard.clear(QClipboard.Mode.Selection)
        # backwards: the press must be on the line, which begins right of the mark
        self.drag((round(_PLAN_SHARE * self._picture().shape[1]), top + _SENTENCE), (4, top + _SENTENCE))
        deadline = time.monotonic() + 1
        while not (selected := clipboard.text(QClipboard.Mode.Selection)) and time.monotonic() < deadline:
            QGuiApplication.processEvents()  # receive the selection of the other process
            time.sleep(_PAUSE)
        return selected

    def looks(self, palette: Palette) -> bool:
        """Return whether the window has the background of this palette."""
        return bool((self._picture()[self._end_of_views() - 5, _IN_A_VIEW] == _rgb(palette.paper)).all())

    def badge(self, colour: str) -> bool:
        """Return whether the badge in the corner has this colour."""
        return bool((self._picture()[-40:, -60:] == _rgb(colour)).all(axis=2).any())

    def readings(self, colour: str) -> list[Pixel]:
        """Return the centres of the round marks of this colour in the plan, from left to right."""
        return _middles(binary_erosion(self._plan(colour), _INSIDE_A_MARK))

    def sensor(self) -> Pixel:
        """Return the centre of the sensor in the plan: a diamond with at most two rays around it."""
        ink = self._plan(LIGHT.ink)
        around = [np.roll(ink, by, (0, 1)) for by in _AROUND]
        return _middles(binary_erosion(ink, _DIAMOND) & (np.sum(around, axis=0) <= 2))[0]

    def _plan(self, colour: str) -> NDArray[np.bool_]:
        """Return where the plan has this colour, and False outside the plan."""
        picture = self._picture()
        coloured = (picture == _rgb(colour)).all(axis=2)
        coloured[:_ABOVE_THE_PLAN] = False
        coloured[self._end_of_views() :] = False  # the card has a mark, too
        coloured[:, round(_PLAN_SHARE * picture.shape[1]) :] = False
        return coloured

    def _end_of_views(self) -> int:
        edge = self._picture()[:, _IN_A_VIEW]
        on_paper = [(edge == _rgb(palette.paper)).all(axis=1) for palette in (LIGHT, DARK)]
        return int(np.flatnonzero(np.logical_or(*on_paper))[-1]) + 1

    def _picture(self) -> NDArray[np.uint8]:
        image = QGuiApplication.primaryScreen().grabWindow(int(self._window)).toImage()
        image = image.convertToFormat(QImage.Format.Format_RGB32)
        words = np.frombuffer(image.constBits(), np.uint8).reshape(image.height(), image.width(), 4)
        return words[:, :, 2::-1].copy()


def _xdotool(*arguments: str) -> str:
    return subprocess.run(
        ["xdotool", *arguments], check=True, capture_output=True, text=True, timeout=HANG
    ).stdout.strip()


def _rgb(colour: str) -> NDArray[np.uint8]:
    return np.array(QColor(colour).getRgb()[:3], np.uint8)


def _middles(filled: NDArray[np.bool_]) -> list[Pixel]:
    places, count = label(filled)
    return sorted((round(x), round(y)) for y, x in center_of_mass(filled, places, range(1, count + 1)))
