"""All views of the window: one large view at a time in the middle, the small views in docks beside it."""

import json
from collections.abc import Callable
from contextlib import suppress
from typing import TypeVar, cast

from pydantic import TypeAdapter
from PySide6 import QtWidgets
from PySide6.QtCore import QByteArray, QChildEvent, QEvent, QSize, Qt, Signal, Slot
from PySide6.QtGui import QAction, QKeySequence, QResizeEvent, QShowEvent

from sonarhw_gui.model.look import Look
from sonarhw_gui.model.shown import Shown
from sonarhw_gui.model.theme import text_font
from sonarhw_gui.session.showing import ShownModel
from sonarhw_gui.views.base import View
from sonarhw_gui.views.bscan import BScanView
from sonarhw_gui.views.differences import DifferenceView
from sonarhw_gui.views.echoes import EchoListView
from sonarhw_gui.views.plan import PlanView, SideBySide
from sonarhw_gui.views.ranges import RangeView
from sonarhw_gui.views.table import TableView
from sonarhw_gui.views.trace import TraceView
from sonarhw_gui.widgets import PlainLabel, arranged

# A view or panel is drawn while it is visible. It keeps what it drew, to draw only changes.


class Drawing:
    """What a view or panel has drawn last."""

    def __init__(self, draw: Callable[[Shown], None]) -> None:
        """`draw` draws the changes since its last call."""
        self._draw = draw
        self._drawn: Shown | None = None  # None: nothing, or released

    def show_state(self, shown: Shown) -> None:
        """Draw it."""
        self._drawn = shown
        self._draw(shown)

    def release(self, shown: Shown) -> None:
        """Draw it without a scan if it is of another scan or scene than `shown`, whose paths it would keep alive."""
        drawn = self._drawn
        if drawn is not None and (drawn.scene is not shown.scene or drawn.readings is not shown.readings):
            self._drawn = None
            self._draw(drawn.without_scan)


# A dock with one small view, under a thin title bar: it can be moved, floated, stacked as a tab and closed.


_BUTTON = 10  # pixels, icons of the title bar
_TEXT = 0.8  # of the default text size


class OpenedDock(QtWidgets.QDockWidget):
    """A dock with an action that opens it in front of other tabs, or closes it. Its name is the key of the layout."""

    def __init__(self, name: str, content: QtWidgets.QWidget, parent: QtWidgets.QWidget, key: str = "") -> None:
        super().__init__(name, parent)
        self.in_front = False  # whether it is visible, and not behind another tab
        self.setObjectName(name)
        self.setWidget(content)
        self.opener = QAction(name, self, checkable=True, shortcut=QKeySequence(key))  # checked: it is in front
        self.opener.triggered.connect(self._open_or_close)
        self.visibilityChanged.connect(self._note_visibility)

    def bring_to_front(self) -> None:
        """Open it in front of the others."""
        self.show()
        self.raise_()

    @Slot()
    def float_or_put_back(self) -> None:
        """Float it in a window of its own, or put it back."""
        self.setFloating(not self.isFloating())

    @Slot(bool)
    def _note_visibility(self, visible: bool) -> None:
        self.in_front = visible
        self.opener.setChecked(visible)

    @Slot(bool)
    def _open_or_close(self, wanted: bool) -> None:
        if wanted:
            self.bring_to_front()
        else:
            self.close()


def _title_bar(dock: OpenedDock) -> QtWidgets.QWidget:
    """Return the name of a view, and buttons that float and close its dock; a drag of the name moves the dock."""
    bar, name = QtWidgets.QWidget(dock), PlainLabel(dock.windowTitle())
    row = arranged(QtWidgets.QHBoxLayout(bar), name, rest=name, margins=(8, 0, 2, 0))
    bar.setToolTip("Drag to move this view: beside or onto another view, or out of the window")
    pixmap = QtWidgets.QStyle.StandardPixmap
    float_tip = "Float this view in a window of its own, or put it back"
    for what, tip, icon, slot in (
        ("float", float_tip, pixmap.SP_TitleBarNormalButton, dock.float_or_put_back),
        ("close", "Close this view; the View menu opens it again", pixmap.SP_TitleBarCloseButton, dock.close),
    ):
        button = QtWidgets.QToolButton(autoRaise=True)
        button.setIcon(bar.style().standardIcon(icon, QtWidgets.QStyleOptionDockWidget(), dock))
        button.setIconSize(QSize(_BUTTON, _BUTTON))
        button.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        button.setToolTip(tip)
        button.setAccessibleName(f"{what} {dock.windowTitle()}")
        button.clicked.connect(slot)
        row.addWidget(button)
    return bar


_SPACE = 9  # pixels, of a tab beside its name; that of Qt is 24


class _NarrowTabs(QtWidgets.QProxyStyle):
    """Less space beside the names of tabs, so that those of all panels fit in the width of a panel."""

    def pixelMetric(
        self,
        metric: QtWidgets.QStyle.PixelMetric,
        option: QtWidgets.QStyleOption | None = None,
        widget: QtWidgets.QWidget | None = None,
    ) -> int:
        """Return a length of the style in pixels."""
        if metric == QtWidgets.QStyle.PixelMetric.PM_TabBarTabHSpace:
            return _SPACE
        return super().pixelMetric(metric, option, widget)


_LOW, _LOWEST = 850, 680  # pixels; on a lower screen, the small views share two stacks or one, instead of three
_PANEL_HEIGHT = 0.45  # of the height of all views
_LAYOUT = 1  # version of the arrangement: panels are docks of the views; Qt refuses an arrangement of another version
_RIGHT = Qt.DockWidgetArea.RightDockWidgetArea
_SIDES = (_RIGHT, Qt.DockWidgetArea.LeftDockWidgetArea)
_V = TypeVar("_V", bound=View)


class _Stage(QtWidgets.QStackedWidget):
    """The large views. Only the visible one needs space."""

    def minimumSizeHint(self) -> QSize:
        """Return that of the visible view."""
        shown = self.currentWidget()
        return super().minimumSizeHint() if shown is None else shown.minimumSizeHint()


_SHARES = b"\nshares of the width: "  # in a saved arrangement, between that of Qt and the shares as JSON


def _shares_in(saved: bytes) -> dict[int, float]:
    """Return the share of each large view; none if the text is empty or damaged."""
    with suppress(ValueError):
        return TypeAdapter(dict[int, float]).validate_json(saved)
    return {}


class ViewArea(QtWidgets.QMainWindow):
    """The views. A new view needs one line in `__init__`; menus, keys, gestures, pictures and repaints follow.

    It is a main window inside the window. Its docks on the right hold the small views and the panels, so that no panel
    takes width from the large view. Tabs have their whole names; those that do not fit scroll.
    """

    uncovered = Signal()  # a view became visible
    answered = Signal()  # the user selected a reading, or asked a heading

    def __init__(self) -> None:
        super().__init__()
        self._tab_style = _NarrowTabs()  # a tab bar does not keep its style alive
        self._tab_style.setParent(self)
        self.setWindowFlags(Qt.WindowType.Widget)
        self.large: list[View] = []
        self.docks: list[OpenedDock] = []
        self.panels: list[OpenedDock] = []
        self._stacks: list[list[OpenedDock]] = [[], [], []]
        self._restored = False  # whether the arrangement is that of an earlier session
        self._drawings: dict[View, Drawing] = {}
        self._widths: dict[int, float] = {}  # share of each large view that the user has resized
        self.stage = _Stage()
        self.plan = self._large(PlanView())
        self.side_by_side = self._large(SideBySide())
        self.bscan = self._large(BScanView())
        self.trace = self._beside(TraceView(), stack=0)
        self.ranges = self._beside(RangeView(), stack=1)
        self.table = self._beside(TableView(), stack=2)
        self.echo_list = self._beside(EchoListView(), stack=2)
        self.differences = self._beside(DifferenceView(), stack=2)
        self._column = QtWidgets.QWidget()
        arranged(QtWidgets.QVBoxLayout(self._column), self.stage, rest=self.stage)
        self.setCentralWidget(self._column)
        self.setDockNestingEnabled(True)
        self.setTabPosition(Qt.DockWidgetArea.AllDockWidgetAreas, QtWidgets.QTabWidget.TabPosition.North)
        self.stage.currentChanged.connect(self.uncovered)
        self.stage.currentChanged.connect(self._share_width)
        self.reset_layout()

    @property
    def large_view(self) -> View:
        """The visible large view."""
        return self.large[self.stage.currentIndex()]

    @property
    def beside(self) -> list[View]:
        """The small views."""
        return [_view_in(dock) for dock in self.docks]

    @property
    def all(self) -> list[View]:
        """All views."""
        return [*self.large, *self.beside]

    @property
    def openers(self) -> list[QAction]:
        """The actions that open and close the small views."""
        return [dock.opener for dock in self.docks]

    def frame_large_view(self, above: QtWidgets.QWidget, below: QtWidgets.QWidget) -> None:
        """Put a widget above the large view, and another one below it."""
        column = cast(QtWidgets.QVBoxLayout, self._column.layout())
        column.insertWidget(0, above)
        column.addWidget(below)

    def bring_to_front(self, view: View) -> None:
        """Open a small view in front of the others."""
        next(dock for dock in self.docks if _view_in(dock) is view).bring_to_front()

    def add_panel(self, panel: OpenedDock) -> None:
        """Add a panel as a tab behind the lowest small views."""
        self.panels.append(panel)
        self._put_panel(panel)

    def make_room(self, panel: OpenedDock) -> None:
        """Give a panel that opens a useful height."""
        least = round(_PANEL_HEIGHT * self.height())
        if not panel.isFloating() and panel.height() < least:
            self.resizeDocks([panel], [least], Qt.Orientation.Vertical)

    def _put_panel(self, panel: OpenedDock) -> None:
        lowest = next(stack for stack in reversed(self._stacks) if stack)
        self.addDockWidget(_RIGHT, panel)
        self.tabifyDockWidget(lowest[-1], panel)
        lowest[0].raise_()

    def childEvent(self, event: QChildEvent) -> None:
        """Set a new tab bar up; Qt makes them itself and would shorten a name to a letter."""
        super().childEvent(event)
        bar = event.child()
        if event.polished() and isinstance(bar, QtWidgets.QTabBar):
            bar.setStyle(self._tab_style)
            bar.setElideMode(Qt.TextElideMode.ElideNone)
            bar.setUsesScrollButtons(True)

    def connect_gestures(self, showing: ShownModel) -> None:
        """Connect the user actions of all views with the session."""
        for view in self.all:
            gestures = view.gestures
            gestures.picked.connect(showing.choose)
            gestures.picked.connect(self.answered)
            gestures.asked.connect(self.answered)
            gestures.pointed.connect(showing.point_at)
            gestures.edited.connect(showing.edit)
            gestures.cancelled.connect(showing.cancel)
            gestures.switched.connect(showing.switch)
            gestures.asked.connect(showing.ask)
            gestures.turned_question.connect(showing.turn_question)
            gestures.path_pointed.connect(showing.point_at_path)
            gestures.bscan_requested.connect(showing.request_bscan)

    def show_number(self, number: int) -> None:
        """Bring a large view to the front."""
        self.stage.setCurrentIndex(number)

    def show_large(self, shown: Shown) -> None:
        """Update the visible large view."""
        self._drawings[self.large_view].show_state(shown)

    def show_plot_beside(self, place: int, shown: Shown) -> None:
        """Update a plot beside the large view if it is visible; `place`: below `plots_beside`, from the top."""
        dock = [dock for dock in self.docks if not _view_in(dock).entry.is_text][place]
        if dock.in_front:
            self._drawings[_view_in(dock)].show_state(shown)

    @property
    def plots_beside(self) -> int:
        """The number of small views that are plots, visible or not."""
        return sum(not view.entry.is_text for view in self.beside)

    def show_texts(self, shown: Shown) -> None:
        """Update the visible views of text."""
        for dock in self.docks:
            if _view_in(dock).entry.is_text and dock.in_front:
                self._drawings[_view_in(dock)].show_state(shown)

    def release_hidden(self, shown: Shown) -> None:
        """Release what hidden views have drawn of another scan or scene."""
        visible = {self.large_view, *(_view_in(dock) for dock in self.docks if dock.in_front)}
        for view, drawing in self._drawings.items():
            if view not in visible:
                drawing.release(shown)

    def set_look(self, look: Look) -> None:
        """Use the text size of `look` for the title bars."""
        for dock in self.docks:
            cast(PlainLabel, dock.titleBarWidget().findChild(PlainLabel)).setFont(text_font(look, _TEXT))

    @Slot()
    def fit(self) -> None:
        """Reset the range of every view."""
        for view in self.all:
            view.fit()

    @Slot()
    def reset_layout(self) -> None:
        """Put all small views back in their stacks on the right: three, two on a low screen, one on a very low one."""
        self._widths = {}
        stacks = self._stacks_for(self.screen().availableSize().height())
        for dock in (*self.docks, *self.panels):
            dock.setFloating(False)
            self.removeDockWidget(dock)
        for stack in stacks:
            self.addDockWidget(_RIGHT, stack[0])
            for dock in stack[1:]:
                self.tabifyDockWidget(stack[0], dock)
        for panel in self.panels:
            self._put_panel(panel)
        for dock in (*self.docks, *self.panels):
            dock.show()
        for stack in stacks:
            stack[0].raise_()
        self._arranged = stacks
        self._share_first()

    def _share_first(self) -> None:
        """Give the stacks of small views their first sizes."""
        stacks = self._arranged
        shares = [205, 220, 265] if len(stacks) == 3 else [1] * len(stacks)
        heights = [round(self.height() * share / sum(shares)) for share in shares]
        tops = [stack[0] for stack in stacks]
        self.resizeDocks(tops, heights, Qt.Orientation.Vertical)
        self.resizeDocks(tops, [self._width_beside] * len(tops), Qt.Orientation.Horizontal)

    def saveState(self, version: int | None = _LAYOUT) -> QByteArray:
        """Return the arrangement, with the share of the width that each large view has.

        Qt keeps widths in pixels, which mean another share in a window that is maximised after it was restored.
        """
        return super().saveState(version or _LAYOUT).append(_SHARES + json.dumps(self._widths).encode())

    def restoreState(
        self, state: "QByteArray | bytes | bytearray | memoryview[int]", version: int | None = _LAYOUT
    ) -> bool:
        """Restore an arrangement that `saveState` returned; one that Qt refuses changes nothing."""
        docks, _, shares = bytes(QByteArray(state).data()).partition(_SHARES)
        done = super().restoreState(docks, version or _LAYOUT)
        if done:
            self._restored = True
            self._widths = _shares_in(shares)
            self._share_width()
        return done

    def event(self, event: QEvent) -> bool:
        """Remember the width that the user gave the large view with the line beside it."""
        done = super().event(event)
        if event.type() is QEvent.Type.MouseButtonRelease and event.isAccepted():
            self._note_width()
        return done

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Keep the shares of the width; Qt would give the large view all that is gained or lost."""
        super().resizeEvent(event)
        if self.isVisible() and event.oldSize().width() != self.width():
            self._share_width()

    def showEvent(self, event: QShowEvent) -> None:
        """Arrange the views in the size of the window at the first time, unless they were restored."""
        super().showEvent(event)
        if self._restored:
            self._share_width()
        else:
            self._restored = True
            if self._arranged == self._stacks_for(self.screen().availableSize().height()):
                self._share_first()
            else:  # on another screen
                self.reset_layout()

    def _stacks_for(self, height: int) -> list[list[OpenedDock]]:
        """Return the small views by stack, for a screen of this height."""
        first, second, third = self._stacks
        if height < _LOWEST:
            return [first + second + third]
        return [first + second, third] if height < _LOW else [first, second, third]

    @property
    def _width_beside(self) -> int:
        """The width of the small views beside the large one, pixels."""
        return round((1 - self._widths.get(self.stage.currentIndex(), self.large_view.entry.width)) * self.width())

    def _note_width(self) -> None:
        """Keep the width that the visible large view has now, as a share."""
        if self.isVisible():
            self._widths[self.stage.currentIndex()] = self.stage.width() / self.width()

    @Slot()
    def _share_width(self) -> None:
        """Give the visible large view its share of the width, and the small views beside it the rest."""
        beside = [
            dock
            for dock in (*self.docks, *self.panels)
            if dock.in_front and not dock.isFloating() and self.dockWidgetArea(dock) in _SIDES
        ]
        now = self.width() - self.stage.width()
        if beside and now > 0:
            widths = [round(dock.width() * self._width_beside / now) for dock in beside]
            self.resizeDocks(beside, widths, Qt.Orientation.Horizontal)

    def _large(self, view: _V) -> _V:
        self.large.append(view)
        self._drawings[view] = Drawing(view.show_state)
        self.stage.addWidget(cast(QtWidgets.QWidget, view))
        return view

    def _beside(self, view: _V, stack: int) -> _V:
        """Add a small view; `stack`: its initial place, from the top. Views of one stack are tabs."""
        dock = OpenedDock(view.entry.name, cast(QtWidgets.QWidget, view), self)
        dock.setTitleBarWidget(_title_bar(dock))
        dock.opener.setStatusTip(f"Open, bring to the front or close the view {view.entry.name}")
        self.docks.append(dock)
        self._drawings[view] = Drawing(view.show_state)
        self._stacks[stack].append(dock)
        dock.visibilityChanged.connect(self.uncovered)
        return view


def _view_in(dock: OpenedDock) -> View:
    return cast(View, dock.widget())
