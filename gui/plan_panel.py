"""The plan with its tools above it, one key each, and a line that says what lies under the hand.

Takes what is shown; the plan itself (`view`) hands on gestures.
"""

import math
import time

from PySide6.QtCore import Qt, Slot
from PySide6.QtGui import QAction, QActionGroup, QKeySequence
from PySide6.QtWidgets import QHBoxLayout, QSizePolicy, QToolButton, QVBoxLayout, QWidget

from gui.elided import ElidedLabel
from gui.plan_tools import TOOLS
from gui.plan_view import PlanView
from gui.scene_edit import sensor_at, sensor_turned

_NUDGE, _TURN = 0.01, math.radians(1.0)  # m, rad
_PAUSE = 1.0  # s: key strokes closer than this are undone together
_MOVES = {"Shift+Left": (-1, 0), "Shift+Right": (1, 0), "Shift+Down": (0, -1), "Shift+Up": (0, 1)}
_TURNS = {"Shift+PgUp": 1, "Shift+PgDown": -1}


class PlanPanel(QWidget):
    """Tools over a plan."""

    def __init__(self, view: PlanView) -> None:
        super().__init__()
        self.view = view
        self._nudged, self._nudging = 0.0, object()
        self.tools = QActionGroup(self)
        self.said = ElidedLabel()
        view.told.connect(self.said.setText)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addWidget(self._bar())
        column.addWidget(view, stretch=1)
        self._add_keys()

    def _bar(self) -> QWidget:
        bar = QWidget()
        row = QHBoxLayout(bar)
        row.setContentsMargins(6, 2, 8, 2)
        row.setSpacing(2)
        for tool in TOOLS:
            action = self._action(tool.name, tool.key, tool.tip)
            action.setCheckable(True)
            action.setData(tool)
            self.tools.addAction(action)
            row.addWidget(_button(action))
        self.remove = self._action("Remove", "Del", "Take out the chosen wall or post")
        self.remove.triggered.connect(self.view.remove_chosen)
        row.addWidget(_button(self.remove))
        row.addSpacing(8)
        row.addWidget(self.said, stretch=1)
        self.tools.actions()[0].setChecked(True)
        self.tools.triggered.connect(self._hold)
        return bar

    def _add_keys(self) -> None:
        for key, by in _MOVES.items():
            self._action("Move the sensor", key, "Move the sensor by a centimetre").setData(by)
        for key, by in _TURNS.items():
            self._action("Turn the sensor", key, "Turn the sensor by a degree").setData(by)
        for action in self.actions():
            if action.data() is not None and not action.isCheckable():
                action.triggered.connect(self._nudge)

    def _action(self, text: str, key: str, tip: str) -> QAction:
        action = QAction(text, self, shortcut=QKeySequence(key), toolTip=f"{tip} ({key})", statusTip=tip)
        self.addAction(action)
        return action

    @Slot(QAction)
    def _hold(self, action: QAction) -> None:
        self.view.hold(action.data())

    @Slot()
    def _nudge(self) -> None:
        shown, by = self.view.shown, self.sender().data()
        if shown is None or shown.scene.place is None:
            return
        now = time.monotonic()
        if now - self._nudged > _PAUSE:
            self._nudging = object()
        self._nudged = now
        if isinstance(by, int):
            self.view.change(lambda scene: sensor_turned(scene, by * _TURN), shown.scene, self._nudging)
            return
        x, y = shown.scene.place.position
        to = x + by[0] * _NUDGE, y + by[1] * _NUDGE
        self.view.change(lambda scene: sensor_at(scene, to), shown.scene, self._nudging)


def _button(action: QAction) -> QToolButton:
    button = QToolButton(autoRaise=True)
    button.setDefaultAction(action)
    button.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextOnly)
    button.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # keys stay with the window
    button.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
    return button
