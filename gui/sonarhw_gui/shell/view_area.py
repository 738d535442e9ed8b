"""All views of the window: one large view at a time on the left, the small views in a column on the right."""

from typing import TypeVar, cast

from PySide6.QtCore import Qt, Slot
from PySide6.QtWidgets import QSplitter, QStackedWidget, QWidget

from sonarhw_gui.bscan.bscan_view import BScanView
from sonarhw_gui.plan.plan_view import PlanView
from sonarhw_gui.plan.side_by_side import SideBySide
from sonarhw_gui.readings.range_view import RangeView
from sonarhw_gui.readings.table_view import TableView
from sonarhw_gui.session.shown_model import ShownModel
from sonarhw_gui.shown.shown import Shown
from sonarhw_gui.trace.trace_view import TraceView
from sonarhw_gui.view import View

_LARGE_SHARE, _COLUMN_SHARE = 690, 590  # pixels at the default width
_V = TypeVar("_V", bound=View)


class ViewArea(QSplitter):
    """The views. A new view needs one line in `__init__`; menus, keys, gestures, pictures and repaints follow."""

    def __init__(self) -> None:
        super().__init__(Qt.Orientation.Horizontal)
        self.large: list[View] = []
        self.beside: list[View] = []
        self._heights: list[int] = []
        self.stage, self._column = QStackedWidget(), QSplitter(Qt.Orientation.Vertical)
        self.plan = self._large(PlanView())
        self.side_by_side = self._large(SideBySide())
        self.bscan = self._large(BScanView())
        self.trace = self._beside(TraceView(), height=215)
        self.ranges = self._beside(RangeView(), height=265)
        self.table = self._beside(TableView(), height=165)
        self._arrange()

    @property
    def large_view(self) -> View:
        """The visible large view."""
        return self.large[self.stage.currentIndex()]

    @property
    def all(self) -> list[View]:
        """All views."""
        return [*self.large, *self.beside]

    def connect_gestures(self, showing: ShownModel) -> None:
        """Connect the user actions of all views with the session."""
        for view in self.all:
            gestures = view.gestures
            gestures.picked.connect(showing.choose)
            gestures.pointed.connect(showing.point_at)
            gestures.edited.connect(showing.edit)
            gestures.cancelled.connect(showing.cancel)
            gestures.switched.connect(showing.switch)
            gestures.bscan_requested.connect(showing.request_bscan)

    def show_state(self, shown: Shown) -> None:
        """Update the visible plots. `show_texts` updates the views of text."""
        self._show(shown, text=False)

    def show_texts(self, shown: Shown) -> None:
        """Update the visible views of text."""
        self._show(shown, text=True)

    @Slot()
    def fit(self) -> None:
        """Reset the range of every view."""
        for view in self.all:
            view.fit()

    def _show(self, shown: Shown, text: bool) -> None:
        for view in self.all:
            if view.entry.is_text is text and view.isVisibleTo(self):
                view.show_state(shown)

    def _large(self, view: _V) -> _V:
        self.large.append(view)
        self.stage.addWidget(cast(QWidget, view))
        return view

    def _beside(self, view: _V, height: int) -> _V:
        self.beside.append(view)
        self._column.addWidget(cast(QWidget, view))
        self._heights.append(height)
        return view

    def _arrange(self) -> None:
        self.setObjectName("views")  # sizes are stored under these names
        self._column.setObjectName("side")
        self._column.setSizes(self._heights)
        self.addWidget(self.stage)
        self.addWidget(self._column)
        self.setSizes([_LARGE_SHARE, _COLUMN_SHARE])
        for splitter in (self, self._column):
            splitter.setChildrenCollapsible(False)
