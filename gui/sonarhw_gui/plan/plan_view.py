"""The view "Plan": the plan, its tools, and a line that describes the object under the mouse."""

import math
from functools import partial

from PySide6.QtCore import QMargins, Qt, Slot
from PySide6.QtGui import QAction, QActionGroup, QKeySequence
from PySide6.QtWidgets import QHBoxLayout, QSizePolicy, QToolButton, QVBoxLayout, QWidget

from sonarhw_gui.dialogs.one_dialog import close_dialogs
from sonarhw_gui.parts.elided import ElidedLabel
from sonarhw_gui.parts.flow_layout import FlowLayout
from sonarhw_gui.parts.label_slot import LabelSlot
from sonarhw_gui.plan.plan_drawing import PlanDrawing
from sonarhw_gui.plan.plan_tools import TOOLS
from sonarhw_gui.plan.typed_surface import TypedSurface
from sonarhw_gui.shown.shown import Shown
from sonarhw_gui.view import Gestures, ViewEntry

_MOVES = {"Left": (-1, 0), "Right": (1, 0), "Down": (0, -1), "Up": (0, 1)}
_ZOOM = 1.25
_FITS = (
    ("Fit room", "Home", "Show the room and the sensor; readings outside are arrows at the edge", PlanDrawing.fit),
    ("Fit everything", "Shift+F", "Show the room, the sensor and every reading", PlanDrawing.fit_everything),
)
_QUESTIONS = (("Ask left", "[", 1.0), ("Ask right", "]", -1.0))  # °, counter-clockwise
_TURNS = {"left": ("Shift+PgUp", 1), "right": ("Shift+PgDown", -1)}


class PlanView(QWidget):
    """The plan with a row of tools above it."""

    entry = ViewEntry("Plan", "The room to scale", key="1", menu="Plan")

    def __init__(self) -> None:
        super().__init__()
        self.gestures = Gestures(self)
        self.drawing = view = PlanDrawing(self.gestures)
        self.tools = QActionGroup(self)
        self.message = ElidedLabel()
        self.typed: TypedSurface | None = None  # the dialog for coordinates, opened last
        view.message_changed.connect(self.message.setText)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addWidget(self._bar())
        column.addWidget(view, stretch=1)
        self._add_keys()

    def show_state(self, shown: Shown) -> None:
        """Draw the changes since the last call."""
        self.drawing.show_state(shown)

    def fit(self) -> None:
        """Show the whole room."""
        self.drawing.fit()

    def picture(self) -> QWidget:
        """Return the plan without its tools."""
        return self.drawing

    def _bar(self) -> QWidget:
        bar, tools = QWidget(), QWidget()
        row, buttons = QHBoxLayout(bar), FlowLayout(tools, QMargins(2, 2, 4, 2), gap=0)
        row.setContentsMargins(0, 0, 4, 0)
        row.setSpacing(0)
        for tool in TOOLS:
            action = self._action(tool.name, tool.key, tool.tip)
            action.setCheckable(True)
            action.setData(tool)
            self.tools.addAction(action)
            buttons.addWidget(_button(action))
        self.remove = self._action("Remove", "Del", "Remove the selected wall or post")
        self.remove.triggered.connect(self.drawing.controller.remove_chosen)
        buttons.addWidget(_button(self.remove))
        message = LabelSlot(self.message)
        message.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)  # the tools come first
        row.addWidget(tools)
        row.addWidget(message, stretch=1)
        self.tools.actions()[0].setChecked(True)
        self.tools.triggered.connect(self._set_tool)
        return bar

    def _add_keys(self) -> None:
        controller = self.drawing.controller
        for side, by in _MOVES.items():
            tip = "Move the sensor by 1 cm; with Edit, the selected wall or post"
            self._action(f"Move {side.lower()}", f"Shift+{side}", tip).triggered.connect(partial(controller.nudge, *by))
        for side, (key, steps) in _TURNS.items():
            action = self._action(f"Turn {side}", key, "Turn the sensor by 1°")
            action.triggered.connect(partial(controller.turn, steps))
        for name, key, tip, fit in _FITS:
            self._action(name, key, tip).triggered.connect(partial(fit, self.drawing))
        for name, key, degrees in _QUESTIONS:
            action = self._action(name, key, "Explain the next heading on this side, without a scan")
            action.triggered.connect(partial(self._turn_question, math.radians(degrees)))
        for name, key, post in (("Add wall…", "Ctrl+Alt+W", False), ("Add post…", "Ctrl+Alt+P", True)):
            action = self._action(name, key, "Type the coordinates")
            action.triggered.connect(partial(self._type_surface, post))
        for name, key, scale in (("Zoom in", "+", 1 / _ZOOM), ("Zoom out", "-", _ZOOM)):
            action = self._action(name, key, "About the middle; the mouse wheel zooms about the pointer")
            action.triggered.connect(partial(self.drawing.zoom, scale))
        for side, by in _MOVES.items():
            action = self._action(f"Pan {side.lower()}", f"Ctrl+Shift+{side}", "Pan by a tenth of the view")
            action.triggered.connect(partial(self.drawing.pan, *by))

    def _action(self, text: str, key: str, tip: str) -> QAction:
        action = QAction(text, self, shortcut=QKeySequence(key), toolTip=f"{tip} ({key})", statusTip=tip)
        self.addAction(action)
        return action

    def _type_surface(self, post: bool) -> None:
        shown = self.drawing.shown
        if shown is None or shown.scene.room is None:
            self.message.setText("open a room first")
            return
        controller = self.drawing.controller
        close_dialogs(self.window())
        self.typed = TypedSurface(lambda: controller.scene, shown.look.unit, self.gestures, post, self)
        self.typed.show()

    def _turn_question(self, by: float) -> None:
        self.gestures.turned_question.emit(by)

    @Slot(QAction)
    def _set_tool(self, action: QAction) -> None:
        self.drawing.controller.set_tool(action.data())


def _button(action: QAction) -> QToolButton:
    button = QToolButton(autoRaise=True)
    button.setDefaultAction(action)
    button.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextOnly)
    button.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # the window keeps the keyboard focus
    return button
