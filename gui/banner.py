"""The banner: one line over the views for what went wrong, until it is put away or a new scan begins.

Takes messages; hands on nothing. Never a dialog: the scan goes on underneath.
"""

from PySide6.QtCore import Slot
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QSizePolicy, QToolButton

from gui.palette import WARNING_INK, WARNING_PAPER


class Banner(QFrame):
    """Hidden where there is nothing to say."""

    def __init__(self) -> None:
        super().__init__()
        self.setObjectName("banner")
        self.setStyleSheet(f"#banner {{ background: {WARNING_PAPER}; }} #banner QLabel {{ color: {WARNING_INK}; }}")
        self._label = QLabel()
        self._label.setWordWrap(True)
        self._label.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        close = QToolButton(autoRaise=True)
        close.setText("×")
        close.setToolTip("Put this message away")
        close.clicked.connect(self.hide)
        row = QHBoxLayout(self)
        row.setContentsMargins(10, 4, 6, 4)
        row.addWidget(self._label)
        row.addWidget(close)
        self.hide()

    @property
    def message(self) -> str:
        """What it says; empty where it is hidden."""
        return self._label.text() if not self.isHidden() else ""

    @Slot(str)
    def tell(self, message: str) -> None:
        """Say it; nothing to say hides the banner."""
        self._label.setText(f"⚠ {message}" if message else "")
        self.setVisible(bool(message))
