"""The help page: a short introduction, every key, and the classes of readings, on one screen. Not modal."""

from collections.abc import Mapping, Sequence
from html import escape

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QAction, QKeySequence
from PySide6.QtWidgets import QApplication, QDialog, QGridLayout, QHBoxLayout, QLabel, QScrollArea, QVBoxLayout, QWidget

from sonarhw_gui.dialogs.command_palette import plain_name
from sonarhw_gui.look.appearance import Look
from sonarhw_gui.look.palette import MARKS
from sonarhw_gui.plots.legend_pictures import mark_picture

_COLUMNS = 3
_CLASS_WIDTH = 250  # pixels
_ABOUT = (
    "The window shows a scan over its prediction. <b>Click a reading</b> in the plan, the range view or the table: the "
    "sentence explains it, the plan shows the path of its sound, and the trace names every echo. "
    "<b>Drag the sensor</b> to move it, or its beam to turn it: the prediction follows. Esc cancels the drag. "
    "<b>Drop a file</b> on the window to open it: a log, a room, or a scan as CSV. "
    "<b>Point at a name in the legend</b> to read what it means."
)


class HelpPage(QDialog):
    """The help page."""

    def __init__(
        self, groups: Mapping[str, Sequence[QAction]], look: Look, parent: QWidget | None, max_size: QSize
    ) -> None:
        """`max_size`: larger content gets a scroll bar."""
        super().__init__(parent)
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setWindowTitle("sonarhw — help")
        self.area = QScrollArea(widgetResizable=True)
        self.area.setFrameShape(QScrollArea.Shape.NoFrame)
        bar = self.area.verticalScrollBar().sizeHint().width()
        for columns in range(_COLUMNS, 0, -1):
            page = _page(_in_columns(groups, columns), look)
            if page.minimumSizeHint().width() + bar <= max_size.width():
                break
        self.area.setWidget(page)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self.area)
        width = page.minimumSizeHint().width()
        whole = QSize(width, page.heightForWidth(width))
        self.resize((whole + QSize(bar, 0)).boundedTo(max_size))


def _page(columns: Sequence[Sequence[tuple[str, Sequence[QAction]]]], look: Look) -> QWidget:
    page = QWidget()
    about = QLabel(_ABOUT)
    about.setWordWrap(True)
    keys = QGridLayout()
    keys.setHorizontalSpacing(28)
    for column, part in enumerate(columns):
        label = QLabel("".join(_table(name, actions, look) for name, actions in part))
        label.setAlignment(Qt.AlignmentFlag.AlignTop)
        keys.addWidget(label, 0, column)
    beside = QHBoxLayout()
    beside.setSpacing(28)
    beside.addLayout(keys)
    beside.addLayout(_classes(look), stretch=1)
    layout = QVBoxLayout(page)
    layout.setContentsMargins(18, 14, 18, 14)
    layout.addWidget(about)
    layout.addLayout(beside)
    return page


def _classes(look: Look) -> QGridLayout:
    """Return the mark of each class of readings beside its meaning."""
    grid = QGridLayout()
    grid.setSpacing(8)
    grid.setColumnMinimumWidth(1, round(_CLASS_WIDTH * look.scale))
    grid.addWidget(QLabel(_heading("Classes of readings", look)), 0, 0, 1, 2)
    for row, (kind, mark) in enumerate(MARKS.items(), start=1):
        symbol = QLabel(pixmap=mark_picture(kind, look.palette, QApplication.primaryScreen().devicePixelRatio()))
        text = QLabel(f"<b>{mark.name}</b>: {mark.meaning}. {mark.hint}{'.' if mark.hint else ''}", wordWrap=True)
        for column, part in enumerate((symbol, text)):
            part.setAlignment(Qt.AlignmentFlag.AlignTop)
            grid.addWidget(part, row, column)
    grid.setRowStretch(grid.rowCount(), 1)
    return grid


def _in_columns(
    groups: Mapping[str, Sequence[QAction]], most_columns: int
) -> list[list[tuple[str, Sequence[QAction]]]]:
    """Distribute the groups over columns of similar height, in order."""
    heights = {name: len(actions) + 2 for name, actions in groups.items()}
    most = sum(heights.values()) / most_columns
    columns: list[list[tuple[str, Sequence[QAction]]]] = [[]]
    height = 0.0
    for name, actions in groups.items():
        if columns[-1] and height + heights[name] / 2 > most and len(columns) < most_columns:
            columns.append([])
            height = 0.0
        columns[-1].append((name, actions))
        height += heights[name]
    return columns


def _table(name: str, actions: Sequence[QAction], look: Look) -> str:
    rows = "".join(
        f"<tr><td><b>{escape(keys)}</b>&nbsp;&nbsp;</td><td>{escape(plain_name(action))}</td></tr>"
        for action in actions
        if (keys := _keys(action))
    )
    return f"{_heading(name, look)}<table>{rows}</table>"


def _heading(name: str, look: Look) -> str:
    return f'<p style="color: {look.palette.predicted}; margin: 4px 0 2px 0">{escape(name)}</p>'


def _keys(action: QAction) -> str:
    return ", ".join(key.toString(QKeySequence.SequenceFormat.NativeText) for key in action.shortcuts())
