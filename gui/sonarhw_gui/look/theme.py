"""The application's own colours and font: what buttons, lists and labels take from a look.

Takes a `Look`; changes the one application.
"""

import pyqtgraph as pg
from PySide6.QtGui import QColor, QFont, QFontDatabase, QPalette
from PySide6.QtWidgets import QApplication

from sonarhw_gui.look.appearance import Look
from sonarhw_gui.look.palette import Palette


def apply_look(look: Look) -> None:
    """Give every widget of the application the colours and the text size of `look`."""
    QApplication.setPalette(_palette(look.palette))
    QApplication.setFont(text_font(look))
    pg.setConfigOptions(background=look.palette.paper, foreground=look.palette.ink)


def text_font(look: Look, factor: float = 1.0) -> QFont:
    """The system's font, `factor` as large as text is in this look."""
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
