"""The legend above the views. Marks and colours mean the same in all views; tooltips explain each entry."""

from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import pyqtgraph as pg
from pyqtgraph.graphicsItems.ScatterPlotItem import drawSymbol
from PySide6.QtCore import QMargins, QPointF, QRectF, QSize, Qt, Signal, Slot
from PySide6.QtGui import QBrush, QColor, QIcon, QPainter, QPainterPath, QPalette, QPen, QPixmap, QResizeEvent
from PySide6.QtWidgets import QToolButton, QWidget

from sonarhw.readings import Origin
from sonarhw_gui.model.look import LIGHT, MARKS, Class, Look, Palette, Unclassed, ViewLayer
from sonarhw_gui.model.rows import CLASSES, class_name
from sonarhw_gui.model.shown import Shown
from sonarhw_gui.model.theme import NOTE_SIZE, note_symbol
from sonarhw_gui.widgets import FlowLayout

# The eye of a layer in a list: open while the layer is visible, struck out while it is hidden.


EYE_WIDTH = 13.0  # pixels, with the gap beside it
_HALF, _LID = 5.0, 4.6  # pixels, half of its width and height of the lids' control points


def draw_eye(painter: QPainter, colour: str, middle: float, visible: bool) -> None:
    """Draw an eye at the left edge, with its middle at height `middle`."""
    centre = QPointF(_HALF + 0.5, middle)
    left, right = centre - QPointF(_HALF, 0), centre + QPointF(_HALF, 0)
    lids = QPainterPath(left)
    lids.quadTo(centre - QPointF(0, 2 * _LID - 2), right)
    lids.quadTo(centre + QPointF(0, 2 * _LID - 2), left)
    painter.setPen(QPen(QColor(colour), 1.0))
    painter.setBrush(Qt.BrushStyle.NoBrush)
    painter.drawPath(lids)
    painter.setBrush(QColor(colour))
    painter.drawEllipse(QRectF(centre.x() - 1.3, centre.y() - 1.3, 2.6, 2.6))
    if not visible:
        painter.drawLine(centre + QPointF(-4.0, 4.5), centre + QPointF(4.0, -4.5))


# Small pictures of marks, lines and areas, for the legend, lists and the help page.


Picture = Callable[[Palette, float], QPixmap]  # palette, device pixels per pixel
_SIZE = 14  # pixels
_LINE = 26  # pixels
_MIDDLE = QPointF(_SIZE / 2, _SIZE / 2)
_NOTE_AT = QPointF(-2.3, 15.7)  # the symbol is in the upper right quarter of its square
SWITCH_SIZE = QSize(round(EYE_WIDTH) + _SIZE, _SIZE)  # of `switch_picture` with a mark
_FADED = 0.4  # opacity


def switch_picture(picture: Picture, colours: Palette, ratio: float, visible: bool) -> QPixmap:
    """Return an eye, open or struck out, beside the mark or line that it shows or hides."""
    drawn = picture(colours, ratio)
    width, height = drawn.deviceIndependentSize().width(), _SIZE
    both = _blank(round(EYE_WIDTH + width), height, ratio)
    with QPainter(both) as painter:
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        draw_eye(painter, colours.ink if visible else colours.faint, height / 2, visible)
        painter.setOpacity(1.0 if visible else _FADED)
        painter.drawPixmap(QPointF(EYE_WIDTH, 0.0), drawn)
    return both


def no_picture(colours: Palette, ratio: float) -> QPixmap:
    """Return an empty picture, for a class without a mark."""
    return _blank(1, _SIZE, ratio)


def mark_picture(kind: Class, colours: Palette, ratio: float) -> QPixmap:
    """Return the mark of a class."""
    colour, mark = colours.of(kind), MARKS[kind]
    pen, brush = (pg.mkPen(colour, width=1.3), None) if mark.hollow else (None, colour)
    return _symbol(mark.symbol, 10, pg.mkPen(pen), pg.mkBrush(brush), ratio)


def filled_picture(symbol: str, colours: Palette, ratio: float) -> QPixmap:
    """Return a symbol in the colour of text."""
    return _symbol(symbol, 11, pg.mkPen(None), pg.mkBrush(colours.ink), ratio)


def outline_picture(symbol: str, size: int, colour: str, width: float, colours: Palette, ratio: float) -> QPixmap:
    """Return the outline of a symbol; `colour` is a field of the palette."""
    return _symbol(symbol, size, pg.mkPen(getattr(colours, colour), width=width), pg.mkBrush(None), ratio)


def note_picture(colours: Palette, ratio: float) -> QPixmap:
    """Return the symbol of a note."""
    pen = pg.mkPen(colours.note_ink, width=1)
    return _symbol(note_symbol(), NOTE_SIZE, pen, pg.mkBrush(colours.note_paper), ratio, _NOTE_AT)


def line_picture(colour: str, style: Qt.PenStyle, width: float, colours: Palette, ratio: float) -> QPixmap:
    """Return a piece of a line; `colour` is a field of the palette."""
    picture = _blank(_LINE, _SIZE, ratio)
    with QPainter(picture) as painter:
        painter.setPen(pg.mkPen(getattr(colours, colour), width=ratio * width, style=style))
        painter.drawLine(QPointF(0, _SIZE / 2), QPointF(_LINE, _SIZE / 2))
    return picture


def tick_picture(colours: Palette, ratio: float) -> QPixmap:
    """Return the short line at the sensor."""
    picture = _blank(_SIZE, _SIZE, ratio)
    with QPainter(picture) as painter:
        painter.setPen(pg.mkPen(colours.ink, width=2.5 * ratio))
        painter.drawLine(QPointF(1, _SIZE / 2), QPointF(_SIZE - 1, _SIZE / 2))
    return picture


def patch_picture(colour: str, colours: Palette, ratio: float) -> QPixmap:
    """Return a piece of an area; `colour` is a field of the palette."""
    picture = _blank(_SIZE, _SIZE, ratio)
    with QPainter(picture) as painter:
        painter.setPen(QColor(colours.faint))  # a patch without a frame is hardly visible in the dark palette
        painter.setBrush(QColor(getattr(colours, colour)))
        painter.drawRect(QRectF(0.5, 1.5, _SIZE - 1, _SIZE - 3))
    return picture


def _symbol(
    symbol: str | QPainterPath, size: int, pen: QPen, brush: QBrush, ratio: float, middle: QPointF = _MIDDLE
) -> QPixmap:
    picture = _blank(_SIZE, _SIZE, ratio)
    with QPainter(picture) as painter:
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.translate(middle)
        drawSymbol(painter, symbol, size, pen, brush)
    return picture


def _blank(width: int, height: int, ratio: float) -> QPixmap:
    picture = QPixmap(round(width * ratio), round(height * ratio))
    picture.setDevicePixelRatio(ratio)
    picture.fill(Qt.GlobalColor.transparent)
    return picture


ORIGIN = "ORIGIN"  # in a text, stands for the origin of the readings


@dataclass(frozen=True)
class _Entry:
    picture: Picture
    name: str
    meaning: str


_NOTE, _WALL = "note", "wall"
_MANY = 360  # readings; fewer are compared within a moment
_PREDICTIONS = ViewLayer.PREDICTED, ViewLayer.RAYS  # of a room
SOUND = ("sound", "deaf disc", "counted range")  # drawn only while sound is played
# drawn only while the panel of the room search is open
FOUND, SPEAKING = "wall found", {"for it": "speaking_for", "against it": "against"}
_SOLID, _DASHED = Qt.PenStyle.SolidLine, Qt.PenStyle.DashLine
_ENTRIES: dict[Class | ViewLayer, _Entry] = {
    **{
        kind: _Entry(partial(mark_picture, kind), MARKS[kind].name, MARKS[kind].meaning)
        if kind in MARKS
        else _Entry(no_picture, class_name(kind), "neither measured nor predicted")
        for kind in CLASSES
    },
    Unclassed.MEASURED: _Entry(
        partial(mark_picture, Unclassed.MEASURED), ORIGIN, "a reading; there is no room to compare it with"
    ),
    ViewLayer.TRACE: _Entry(
        partial(line_picture, "measured", _SOLID, 2), "trace", "the received signal that the board recorded"
    ),
    ViewLayer.PREDICTED: _Entry(
        partial(line_picture, "predicted", _SOLID, 2),
        "predicted",
        "the range or trace that the model predicts; dashed in the trace view",
    ),
    ViewLayer.THRESHOLD: _Entry(
        partial(line_picture, "threshold", _DASHED, 1),
        "threshold",
        "detection threshold; weaker echoes are not detected",
    ),
    ViewLayer.RAYS: _Entry(
        partial(line_picture, "chosen", _SOLID, 2),
        "rays",
        "the path of the selected reading, bounce by bounce; dotted: predicted, not measured",
    ),
    ViewLayer.BEAM: _Entry(
        partial(patch_picture, "beam"), "beam", "directions with more than half of the power on the axis"
    ),
    ViewLayer.BLANKING: _Entry(
        partial(patch_picture, "blanking"), "blanking", "the board does not detect echoes that arrive within this time"
    ),
}
_EXPLAINED = (
    _Entry(partial(line_picture, "wall", _SOLID, 2), _WALL, "a wall or post of the room"),
    _Entry(partial(filled_picture, "d"), "sensor", "the position of the sensor; drag it to move it"),
    _Entry(
        partial(line_picture, "faint", Qt.PenStyle.DotLine, 2),
        "newest",
        "where the turntable points now",
    ),
    _Entry(
        tick_picture,
        "turntable zero",
        "the heading of step 0 of the turntable: the short line at the sensor",
    ),
    _Entry(note_picture, _NOTE, "a note on a reading; N edits that of the selected reading"),
    _Entry(partial(line_picture, "predicted", _SOLID, 2), SOUND[0], "the burst on its path, with its wavefront"),
    _Entry(
        partial(line_picture, "faint", _DASHED, 1),
        SOUND[1],
        "echoes of walls within this disc arrive while the board is deaf (blanking); pale once the board listens",
    ),
    _Entry(
        partial(outline_picture, "o", 10, "measured", 2),
        SOUND[2],
        "the range that the board would report for an echo at this moment; filled once it detects one",
    ),
    _Entry(
        partial(line_picture, "predicted", _DASHED, 3),
        FOUND,
        "a wall or post that the search for the room has found; the selected one is thick",
    ),
    _Entry(
        partial(outline_picture, "o", 11, "predicted", 2),
        "for it",
        "an echo that speaks for the selected wall or post: without it, the room would not explain this reading",
    ),
    _Entry(
        partial(outline_picture, "x", 11, "long", 2),
        "against it",
        "an echo that speaks against the selected wall or post: without it, the room would explain this reading better",
    ),
    _Entry(
        partial(outline_picture, "o", 11, "chosen", 1.3), "selected", "the selected reading, with a ring in every view"
    ),
    _Entry(
        partial(outline_picture, "crosshair", 11, "chosen", 1.3),
        "pointer",
        "the position of the mouse, in all views",
    ),
)


class Legend(QWidget):
    """Explains marks, lines and areas, and counts the readings of each class.

    An eye shows and hides the readings or lines of an entry in all views.
    """

    switched = Signal(object, bool)  # a class or layer, and whether it becomes visible

    def __init__(
        self, hidden: frozenset[Class | ViewLayer] = frozenset(), switches: bool = True, left_out: Sequence[str] = ()
    ) -> None:
        """`switches`: whether entries have an eye; a legend of a picture has none, and no entries of hidden layers.

        `left_out`: names of entries that are not drawn in the picture.
        """
        super().__init__()
        self._hidden, self._switches, self._left_out = hidden, switches, left_out
        self._palette, self._origin = LIGHT, Origin.MEASURED
        self._counts: dict[Class, int] = dict.fromkeys(CLASSES, 0)  # readings
        self._outdated = False  # whether the counts belong to an older prediction
        self.entries: dict[Class | ViewLayer, QToolButton] = {}
        self._row = row = FlowLayout(self, QMargins(4, 1, 4, 1), gap=1)
        for layer, entry in _ENTRIES.items():
            if switches or layer not in hidden:
                self.entries[layer] = button = self._made(layer, entry)
                row.addWidget(button)
        self.explained = {entry.name: self._explained(entry) for entry in _EXPLAINED}
        for button in self.explained.values():
            row.addWidget(button)
        self.unused: set[QToolButton] = set()  # entries of what is not drawn now
        self.more = QToolButton(autoRaise=True)
        self.more.setCheckable(True)
        self.more.setToolTip("Show the whole legend, or one line of it")
        self.more.toggled.connect(self._fold)
        row.addWidget(self.more)
        self.more.hide()
        self._draw()

    def show_state(self, shown: Shown) -> None:
        """Name the readings by their origin, count those of each class, and show which layers are hidden.

        A class is listed if it has readings or is hidden. Without a room, nothing is predicted.
        """
        counts = shown.rows.counts()
        unused = self._unused_for(shown, counts)
        if (shown.origin, shown.hidden) != (self._origin, self._hidden):
            self._origin, self._hidden = shown.origin, shown.hidden
            self._draw()
        if (counts, shown.outdated) != (self._counts, self._outdated):
            self._counts, self._outdated = counts, shown.outdated
            self._name()
        if unused != self.unused:
            self.unused = unused
            self._fold()

    def _unused_for(self, shown: Shown, counts: dict[Class, int]) -> set[QToolButton]:
        """Return the entries of what is not drawn."""
        room, drawing = shown.scene.room is not None, shown.found_room
        used = {
            self.explained[_NOTE]: bool(shown.notes),
            self.explained[_WALL]: room,
            self.explained[FOUND]: drawing is not None,
            **{self.explained[name]: shown.sound is not None for name in SOUND},
            **{
                self.explained[name]: drawing is not None and len(getattr(drawing, part)) > 0
                for name, part in SPEAKING.items()
            },
        }
        for layer, entry in self.entries.items():
            if isinstance(layer, ViewLayer):
                used[entry] = room or layer not in _PREDICTIONS
            else:
                least = _MANY if layer is Unclassed.WAITING else 0
                used[entry] = counts[layer] > least or layer in shown.hidden
        never = [
            entry for entry in (*self.entries.values(), *self.explained.values()) if entry.text() in self._left_out
        ]
        return {entry for entry, is_used in used.items() if not is_used} | set(never)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Choose the entries of a single line again."""
        super().resizeEvent(event)
        if event.oldSize().width() != self.width():
            self._fold()

    @Slot()
    def _fold(self) -> None:
        """Show the entries in use that fit into one line, and all of them once `more` is pressed."""
        entries = [*self.entries.values(), *self.explained.values()]
        for entry in entries:
            if (size := entry.sizeHint()) != entry.minimumSize():
                entry.setFixedSize(size)  # otherwise each count triggers a new layout of the window
        used = [entry for entry in entries if entry not in self.unused]
        line = self._fitting(used) if self._switches else len(used)
        shown = len(used) if self.more.isChecked() else line
        self.more.setText("less" if self.more.isChecked() else f"{len(used) - line} more")
        parts = {entry: entry in used[:shown] for entry in entries} | {self.more: line < len(used)}
        # Qt lays out at once what becomes visible, and a second line for a moment would move the view below
        for part, visible in sorted(parts.items(), key=lambda item: item[1]):
            if part.isHidden() is visible:
                part.setVisible(visible)

    def _fitting(self, used: list[QToolButton]) -> int:
        """Return how many of these entries fit into one line, with `more` if it is needed."""
        margins = self.contentsMargins() + self._row.contentsMargins()
        width = self.width() - margins.left() - margins.right()
        ends: list[int] = []  # of the entries, pixels
        for entry in used:
            ends.append((ends[-1] + self._row.gap if ends else 0) + entry.sizeHint().width())
        if not ends or ends[-1] <= width:
            return len(used)
        self.more.setText(f"{len(used)} more")  # the widest text
        return bisect_right(ends, width - self._row.gap - self.more.sizeHint().width())

    def set_look(self, look: Look) -> None:
        """Use the colours of `look`."""
        self._palette = look.palette
        self._draw()

    def _made(self, layer: Class | ViewLayer, entry: _Entry) -> QToolButton:
        button = QToolButton(autoRaise=True)
        button.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        button.setToolTip(f"{entry.meaning}. Click to hide or show it in all views")
        button.clicked.connect(lambda: self.switched.emit(layer, layer in self._hidden))
        return button

    def _explained(self, entry: _Entry) -> QToolButton:
        """Return an entry of a mark that is always drawn."""
        button = QToolButton(autoRaise=True)
        button.setText(entry.name)
        button.setToolTip(entry.meaning)
        button.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        button.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        return button

    def _draw(self) -> None:
        for entry, button in zip(_EXPLAINED, self.explained.values(), strict=True):
            drawn = entry.picture(self._palette, self.devicePixelRatioF())
            button.setIcon(QIcon(drawn))
            button.setIconSize(drawn.deviceIndependentSize().toSize())
        for layer, button in self.entries.items():
            picture = _ENTRIES[layer].picture
            if self._switches:
                picture = partial(switch_picture, picture, visible=layer not in self._hidden)
            drawn = picture(self._palette, self.devicePixelRatioF())
            button.setIcon(QIcon(drawn))
            button.setIconSize(drawn.deviceIndependentSize().toSize())
        self._name()

    def _name(self) -> None:
        """Write the names and counts; in grey if hidden, or while a count belongs to an older prediction."""
        for layer, button in self.entries.items():
            name, visible = _ENTRIES[layer].name.replace(ORIGIN, self._origin), layer not in self._hidden
            button.setText(name if isinstance(layer, ViewLayer) else f"{self._counts[layer]} {name}")
            button.setAccessibleName(f"{button.text()}, {'shown' if visible else 'hidden'}")
            colours = QPalette()
            if not visible or (self._outdated and not isinstance(layer, ViewLayer)):
                colours.setColor(QPalette.ColorRole.ButtonText, QColor(self._palette.faint))
            button.setPalette(colours)
        self._fold()
