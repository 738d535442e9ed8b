"""A label that shows any text as it is. Names from files and devices may look like HTML."""

from html import escape

from PySide6.QtCore import Slot
from PySide6.QtGui import QFont, Qt
from PySide6.QtWidgets import QLabel


class PlainLabel(QLabel):
    """A label whose text and tooltip are never interpreted as HTML."""

    def __init__(self, text: str = "", *, wordWrap: bool = False) -> None:
        super().__init__(text, textFormat=Qt.TextFormat.PlainText, wordWrap=wordWrap)

    @Slot(str)
    def setToolTip(self, text: str) -> None:
        """Set the tooltip."""
        super().setToolTip(plain_tip(text))


class TitleLabel(PlainLabel):
    """A bold label."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        bold = QFont()
        bold.setBold(True)  # only this property: a style sheet would keep the colour of the look that it was made in
        self.setFont(bold)


def plain_tip(text: str) -> str:
    """Return a tooltip that shows exactly this text. Qt interprets a tooltip that looks like HTML as HTML."""
    return f"<p>{escape(text)}</p>" if Qt.mightBeRichText(text) else text
