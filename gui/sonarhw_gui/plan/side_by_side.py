"""Side by side: reality left, simulation right, under one pan and zoom.

Takes what is shown; hands on the gestures of both plans.
"""

from functools import cached_property

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QHBoxLayout, QLabel, QVBoxLayout, QWidget

from sonarhw_gui.parts.elided import ElidedLabel
from sonarhw_gui.plan.plan_view import PlanView
from sonarhw_gui.shown.shown import Shown


class SideBySide(QWidget):
    """Two plans: what was measured in the room, and what the model says."""

    picked = Signal(int)  # a reading
    pointed = Signal(object)  # Cursor or None
    edited = Signal(object, str, object)  # Scene, what was done, gesture
    cancelled = Signal(object)  # gesture

    def __init__(self) -> None:
        super().__init__()
        self._row = QHBoxLayout(self)
        self._row.setContentsMargins(0, 0, 0, 0)
        self._row.setSpacing(1)
        self._looked_at = False

    @cached_property
    def reality(self) -> PlanView:
        """The left plan; made when it is first looked at, as the other."""
        return PlanView(predicted=False)

    @cached_property
    def simulation(self) -> PlanView:
        """The right plan."""
        return PlanView(measured=False)

    def show_state(self, shown: Shown) -> None:
        """Draw what has changed since the last call."""
        if not self._looked_at:
            self._looked_at = True
            self._arrange()
        for view in (self.reality, self.simulation):
            view.show_state(shown)

    def fit(self) -> None:
        """Show the whole room in both."""
        if self._looked_at:
            self.reality.fit()

    def _arrange(self) -> None:
        for title, view in (("Reality", self.reality), ("Simulation", self.simulation)):
            self._row.addLayout(_titled(title, view), stretch=1)
            view.picked.connect(self.picked)
            view.pointed.connect(self.pointed)
            view.edited.connect(self.edited)
            view.cancelled.connect(self.cancelled)
        self.simulation.plotItem.setXLink(self.reality.plotItem)
        self.simulation.plotItem.setYLink(self.reality.plotItem)


def _titled(title: str, view: PlanView) -> QVBoxLayout:
    said = ElidedLabel()
    view.told.connect(said.setText)
    head = QHBoxLayout()
    head.setContentsMargins(8, 3, 8, 3)
    head.addWidget(QLabel(f"<b>{title}</b>"))
    head.addWidget(said, stretch=1)
    column = QVBoxLayout()
    column.setSpacing(0)
    column.addLayout(head)
    column.addWidget(view, stretch=1)
    return column
