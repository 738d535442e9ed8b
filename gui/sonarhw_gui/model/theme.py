"""The look as Qt uses it: colours and font of all widgets, and the symbol of notes."""

import pyqtgraph as pg
from PySide6.QtCore import QPointF
from PySide6.QtGui import QColor, QFont, QFontDatabase, QPainterPath, QPalette, QPolygonF
from PySide6.QtWidgets import QApplication

from sonarhw_gui.model.look import Look, Palette

# The symbol of notes: a sheet of paper with a folded corner, in the upper right quarter of its square.
#
# The mark of the reading is in the middle of the square.


NOTE_SIZE = 30  # pixels, of the square
_SHEET = (0.14, -0.48), (0.36, -0.48), (0.48, -0.36), (0.48, -0.1), (0.14, -0.1), (0.14, -0.48)
_FOLD = (0.36, -0.48), (0.36, -0.36), (0.48, -0.36)


def note_symbol() -> QPainterPath:
    """Return the symbol, in a square of side 1 about the origin."""
    path = QPainterPath()
    for corners in (_SHEET, _FOLD):
        path.addPolygon(QPolygonF([QPointF(*corner) for corner in corners]))
    return path


# Colours and font of all widgets, set for the whole application.


def apply_look(look: Look) -> None:
    """Use the colours and text size of `look` in all widgets."""
    QApplication.setPalette(_palette(look.palette))
    QApplication.setFont(text_font(look))
    pg.setConfigOptions(background=look.palette.paper, foreground=look.palette.ink)


def text_font(look: Look, factor: float = 1.0) -> QFont:
    """Return the system's font, scaled by the look's text size and by `factor`."""
    font = QFontDatabase.systemFont(QFontDatabase.SystemFont.GeneralFont)
    font.setPointSizeF(font.pointSizeF() * look.scale * factor)
    return font


def _palette(colours: Palette) -> QPalette:
    role = QPalette.ColorRole
    palette = QPalette()
    for which, colour in {
        role.Window: colours.window,
        role.Base: colours.paper,
        role.AlternateBase: colours.stripe,
        role.Button: colours.button,
        role.WindowText: colours.ink,
        role.Text: colours.ink,
        role.ButtonText: colours.ink,
        role.BrightText: colours.ink,
        role.PlaceholderText: colours.faint,
        role.ToolTipBase: colours.tip_paper,
        role.ToolTipText: colours.ink,
        role.Highlight: colours.highlight,
        role.HighlightedText: "#FFFFFF",
        role.Link: colours.predicted,
    }.items():
        palette.setColor(which, QColor(colour))
    for which in (role.WindowText, role.Text, role.ButtonText):
        palette.setColor(QPalette.ColorGroup.Disabled, which, QColor(colours.faint))
    return palette
