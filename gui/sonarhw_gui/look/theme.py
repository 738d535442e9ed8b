"""Colours and font of all widgets, set for the whole application."""

import pyqtgraph as pg
from PySide6.QtGui import QColor, QFont, QFontDatabase, QPalette
from PySide6.QtWidgets import QApplication

from sonarhw_gui.look.appearance import Look
from sonarhw_gui.look.palette import Palette


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
