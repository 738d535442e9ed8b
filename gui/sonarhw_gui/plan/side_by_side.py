"""The view "Side by side": measured left, predicted right, with one pan and zoom."""

from functools import cached_property

from PySide6.QtWidgets import QHBoxLayout, QVBoxLayout, QWidget

from sonarhw_gui.parts.elided import ElidedLabel
from sonarhw_gui.parts.plain_label import TitleLabel
from sonarhw_gui.plan.plan_drawing import PlanDrawing
from sonarhw_gui.shown.shown import Shown
from sonarhw_gui.view import Gestures, ViewEntry


class SideBySide(QWidget):
    """Two plans: measured readings and predicted readings."""

    entry = ViewEntry("Side by side", "The scan on the left, its prediction on the right", key="2", width=0.72)

    def __init__(self) -> None:
        super().__init__()
        self.gestures = Gestures(self)
        self._row = QHBoxLayout(self)
        self._row.setContentsMargins(0, 0, 0, 0)
        self._row.setSpacing(1)
        self._created = False
        self.title = TitleLabel("Measured")  # of the left plan: the origin of the readings

    @cached_property
    def measured(self) -> PlanDrawing:
        """The left plan. Both plans are created when first visible."""
        return PlanDrawing(self.gestures, predicted=False)

    @cached_property
    def predicted(self) -> PlanDrawing:
        """The right plan."""
        return PlanDrawing(self.gestures, measured=False)

    def show_state(self, shown: Shown) -> None:
        """Draw the changes since the last call."""
        if not self._created:
            self._created = True
            self._arrange()
        self.title.setText(shown.origin.capitalize())
        for view in (self.measured, self.predicted):
            view.show_state(shown)

    def fit(self) -> None:
        """Show the whole room in both plans."""
        if self._created:
            self.measured.fit()
            self.predicted.fit()

    def picture(self) -> QWidget:
        """Return both plans."""
        return self

    def _arrange(self) -> None:
        for title, view in ((self.title, self.measured), (TitleLabel("Predicted"), self.predicted)):
            self._row.addLayout(_titled(title, view), stretch=1)
        self.predicted.plot.setXLink(self.measured.plot)
        self.predicted.plot.setYLink(self.measured.plot)
        for moved, other in ((self.measured, self.predicted), (self.predicted, self.measured)):
            moved.plot.vb.sigRangeChangedManually.connect(other.note_frame)


def _titled(title: TitleLabel, view: PlanDrawing) -> QVBoxLayout:
    message = ElidedLabel()
    view.message_changed.connect(message.setText)
    head = QHBoxLayout()
    head.setContentsMargins(8, 3, 8, 3)
    head.addWidget(title)
    head.addWidget(message, stretch=1)
    column = QVBoxLayout()
    column.setSpacing(0)
    column.addLayout(head)
    column.addWidget(view, stretch=1)
    return column
