"""Random actions of a user: commands, keys, mouse, files and dialogs of a window."""

import random
from collections.abc import Callable, Sequence
from pathlib import Path

from PySide6.QtCore import QObject, QPoint, QPointF, Qt, QTimer
from PySide6.QtGui import QAction, QContextMenuEvent, QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QAbstractItemView, QApplication, QComboBox, QDialog, QLineEdit, QSlider, QTabBar, QWidget
from shiboken6 import Shiboken
from sonarhw_gui.jobs.searches import ACCURACIES
from sonarhw_gui.window.window import MainWindow

from tests.system.gui.driving import pause

_KEYS = (
    *(Qt.Key.Key_Left, Qt.Key.Key_Right, Qt.Key.Key_Up, Qt.Key.Key_Down, Qt.Key.Key_Tab, Qt.Key.Key_Return),
    *(Qt.Key.Key_Escape, Qt.Key.Key_Space, Qt.Key.Key_Delete, Qt.Key.Key_Home, Qt.Key.Key_PageUp, Qt.Key.Key_N),
    *(Qt.Key.Key_S, Qt.Key.Key_W, Qt.Key.Key_E, Qt.Key.Key_BracketLeft, Qt.Key.Key_BracketRight, Qt.Key.Key_F),
)
_MODIFIERS = (*[Qt.KeyboardModifier.NoModifier] * 3, Qt.KeyboardModifier.ShiftModifier, Qt.KeyboardModifier.AltModifier)
_LEFT, _RIGHT = Qt.MouseButton.LeftButton, Qt.MouseButton.RightButton
_SIZES = (1280, 800), (1008, 552), (1900, 1000), (800, 600)
_TEXTS = ("90", "0.3", "top", "match", 'a note, with "quotes"', "=1+1", "Füße", "", "-7", "lab")
_PATIENCE = 300  # ms for a menu or a modal question, which is closed then


class Monkey:
    """Carries out random actions in a window, the same ones for the same seed."""

    def __init__(self, window: MainWindow, files: Sequence[Path], seed: int) -> None:
        self._window, self._files = window, files
        self._random = random.Random(seed)
        window.commands.close.setEnabled(False)
        self._target: QWidget | None = None  # of the mouse or the keys; the action may close and delete it
        self._waiting: QWidget | None = None  # a menu or modal question seen by the last tick
        self._timer = QTimer(window, interval=_PATIENCE)
        self._timer.timeout.connect(self._close_what_waits)
        self._timer.start()
        self._actions: tuple[tuple[int, Callable[[], str]], ...] = (
            (30, self._command),
            (25, self._click),
            (15, self._key),
            (6, self._drag),
            (4, self._wheel),
            (6, self._menu),
            (8, self._dialog),
            (5, self._type),
            (5, self._choose),
            (6, self._open),
            (4, self._scan),
            (3, self._note),
            (1, self._resize),
        )

    def act(self) -> str:
        """Carry out one action, and return what it was."""
        weights, actions = zip(*self._actions, strict=True)
        (action,) = self._random.choices(actions, weights)
        self._target = None
        try:
            done = action()
        except RuntimeError:
            if self._target is None or Shiboken.isValid(self._target):
                raise
            done = "an action that closed its own widget"
        pause(self._random.choice((0, 0, 1, 40)))
        return done

    def every_command(self) -> list[QAction]:
        """Return the commands of window, views and docks, without the one that closes the window."""
        actions = self._window.findChildren(QAction)
        actions = [action for action in actions if action.statusTip() or not action.shortcut().isEmpty()]
        return [action for action in actions if action is not self._window.commands.close]

    # actions

    def _command(self) -> str:
        action = self._random.choice([action for action in self.every_command() if action.isEnabled()])
        text = f"command {action.text()}"
        action.trigger()
        return text

    def _click(self) -> str:
        widget, at = self._somewhere()
        button = self._random.choice((_LEFT, _LEFT, _LEFT, _RIGHT))
        text = f"click {_name(widget)} {at.toTuple()} {button.name}"
        press = QTest.mouseDClick if self._random.random() < 0.1 else QTest.mouseClick
        press(widget, button, self._random.choice(_MODIFIERS[:4]), pos=at)
        return text

    def _drag(self) -> str:
        widget, at = self._somewhere()
        text, view = f"drag {_name(widget)}", widget.parent()
        if isinstance(view, QAbstractItemView) and view.dragEnabled():
            return "no drag and drop: it waits for a real mouse"
        QTest.mousePress(widget, _LEFT, pos=at)
        for _ in range(self._random.randint(1, 6)):
            at = at + QPoint(self._random.randint(-60, 60), self._random.randint(-60, 60))
            QTest.mouseMove(widget, at)
            pause(15)  # about one frame of a display
        QTest.mouseRelease(widget, _LEFT, pos=at)
        return text

    def _wheel(self) -> str:
        widget, at = self._somewhere()
        turn = QPoint(0, self._random.choice((-480, -120, 120, 480)))
        held, phase = Qt.KeyboardModifier.NoModifier, Qt.ScrollPhase.NoScrollPhase
        place = QPointF(widget.mapToGlobal(at))
        event = QWheelEvent(QPointF(at), place, QPoint(), turn, Qt.MouseButton.NoButton, held, phase, False)
        QApplication.sendEvent(widget, event)
        return f"wheel {_name(widget)}"

    def _menu(self) -> str:
        widget, at = self._somewhere()
        reason = QContextMenuEvent.Reason.Mouse
        QApplication.sendEvent(widget, QContextMenuEvent(reason, at, widget.mapToGlobal(at)))
        return f"context menu of {_name(widget)}"

    def _key(self) -> str:
        self._target = target = QApplication.focusWidget() or self._window
        key, modifier = self._random.choice(_KEYS), self._random.choice(_MODIFIERS)
        QTest.keyClick(target, key, modifier)
        return f"key {key.name} with {modifier.name}"

    def _type(self) -> str:
        fields = [field for field in self._front().findChildren(QLineEdit) if field.isVisible() and field.isEnabled()]
        if not fields:
            return "nothing to type into"
        field, text = self._random.choice(fields), self._random.choice(_TEXTS)
        self._target = field
        field.selectAll()
        if text.isascii():
            QTest.keyClicks(field, text)
        else:
            field.insert(text)  # QTest has only the keys of ASCII
        return f"type {text!r}"

    def _choose(self) -> str:
        """Change a combo box, a slider or a tab."""
        kinds = self._random.choice((QComboBox, QSlider, QTabBar))
        found = [widget for widget in self._front().findChildren(kinds) if widget.isVisible() and widget.isEnabled()]
        if not found:
            return "nothing to choose"
        widget = self._random.choice(found)
        if isinstance(widget, QSlider):
            widget.setValue(self._random.randint(widget.minimum(), widget.maximum()))
        else:
            row = self._random.randrange(max(1, widget.count()))
            widget.setCurrentIndex(row)
            if isinstance(widget, QComboBox) and widget.count():
                widget.activated.emit(row)
        return f"choose in {_name(widget)}"

    def _dialog(self) -> str:
        """Accept or close the dialog in front; without one, close a menu."""
        popup, dialogs = QApplication.activePopupWidget(), self._dialogs()
        if popup is not None:
            popup.close()
            return "close a menu"
        if not dialogs:
            return "no dialog"
        dialog = dialogs[-1]
        if self._random.random() < 0.4:
            text, self._target = f"Return in {_name(dialog)}", dialog
            QTest.keyClick(dialog, Qt.Key.Key_Return)
            return text
        dialog.close()
        return f"close {_name(dialog)}"

    def _open(self) -> str:
        path = self._random.choice(self._files)
        self._window.session.open_file(str(path))
        return f"open {path.name}"

    def _scan(self) -> str:
        session = self._window.session
        name, run = self._random.choice(
            (
                ("scan", session.scan),
                ("stop", session.stop),
                ("home", session.live.home),
                ("turn", lambda: session.live.turn(self._random.random())),
                ("disconnect", session.live.disconnect),
                ("connect", session.live.connect),
                ("keep the scan", session.scans.keep),
                ("keep sweeps", session.scans.keep_sweeps),
                ("remove a scan", lambda: session.scans.remove(0)),
                ("compare scans", lambda: session.scans.compare(0, -1) if session.scans.scans else None),
                ("search causes", session.causes.start),
                ("end the search", session.causes.cancel),
                ("find the room", lambda: session.finding.start(ACCURACIES["exact"])),
                ("reject a wall", lambda: session.finding.reject(0)),
                ("end the search for the room", session.finding.cancel),
                ("add a log", lambda: session.scans.open(str(self._random.choice(self._files)))),
                ("ask a heading", lambda: session.showing.ask(self._random.uniform(0.0, 6.3))),
                ("play sound", session.play_sound),
            )
        )
        run()
        return name

    def _note(self) -> str:
        showing = self._window.session.showing
        count = len(showing.shown.readings)
        if not count:
            return "no reading to note"
        reading, text = self._random.randrange(count), self._random.choice(_TEXTS)
        showing.choose(reading)
        showing.pin(reading, text)
        return f"note {text!r} on {reading}"

    def _resize(self) -> str:
        width, height = self._random.choice(_SIZES)
        self._window.resize(width, height)
        return f"resize to {width} × {height}"

    # what is on the screen

    def _dialogs(self) -> list[QDialog]:
        return [dialog for dialog in self._window.findChildren(QDialog) if dialog.isVisible()]

    def _front(self) -> QWidget:
        return QApplication.activePopupWidget() or (self._dialogs() or [self._window])[-1]

    def _somewhere(self) -> tuple[QWidget, QPoint]:
        """Return a random widget of the menu, dialog or window in front, and a point in it."""
        front = self._front() if self._random.random() < 0.7 else self._window
        at = QPoint(self._random.randrange(max(1, front.width())), self._random.randrange(max(1, front.height())))
        child = front.childAt(at)
        self._target = child or front
        return (front, at) if child is None else (child, child.mapFrom(front, at))

    def _close_what_waits(self) -> None:
        """Close a menu or a modal question that the last tick saw: it may block the action that opened it."""
        waiting = QApplication.activeModalWidget() or QApplication.activePopupWidget()
        if waiting is not None and waiting is self._waiting:
            waiting.close()
        self._waiting = waiting


def _name(widget: QObject) -> str:
    parent = widget.parent()
    return f"{type(widget).__name__} of {type(parent).__name__}"
