"""The banner: a line above the views with errors, warnings and offers.

A message stays until the user dismisses it, its cause is gone, or a new scan begins. It is never a dialog, so it does
not block a running scan.
"""

from PySide6.QtCore import Signal, Slot
from PySide6.QtWidgets import QFrame, QHBoxLayout, QPushButton, QSizePolicy, QToolButton

from sonarhw_gui.live.window_status import Status
from sonarhw_gui.look.appearance import Look
from sonarhw_gui.parts.plain_label import PlainLabel
from sonarhw_gui.shown.notices import Notice, Notices, Until


class Banner(QFrame):
    """Shows one notice at a time, the newest of the most severe kind; hidden without notices."""

    answered = Signal(object)  # the value of the accepted or declined offer
    opened = Signal(bool)  # before it is shown: True; after it is hidden: False

    def __init__(self) -> None:
        super().__init__()
        self.setObjectName("banner")
        self._notices = Notices()
        self._label = PlainLabel()
        self._label.setWordWrap(True)
        self._label.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        self.more_button = QToolButton(autoRaise=True)
        self.more_button.setToolTip("Show the next message")
        self.more_button.clicked.connect(self._show_next)
        self.accept_button = QPushButton()
        self.accept_button.clicked.connect(self._accept)
        self.decline_button = QPushButton()
        self.decline_button.clicked.connect(self._decline)
        self.close_button = QToolButton(autoRaise=True)
        self.close_button.setText("×")
        self.close_button.setToolTip("Dismiss this message")
        self.close_button.clicked.connect(self._dismiss)
        row = QHBoxLayout(self)
        row.setContentsMargins(10, 4, 6, 4)
        row.addWidget(self._label)
        row.addWidget(self.accept_button)
        row.addWidget(self.decline_button)
        row.addWidget(self.more_button)
        row.addWidget(self.close_button)
        self.hide()

    @property
    def message(self) -> str:
        """The visible text; empty while the banner is hidden."""
        return self._label.text() if not self.isHidden() else ""

    def show_look(self, look: Look) -> None:
        """Use the colours of `look`."""
        ink, paper = look.palette.warning_ink, look.palette.warning_paper
        self.setStyleSheet(
            f"#banner {{ background: {paper}; }} #banner QLabel, #banner QToolButton {{ color: {ink}; }}"
        )

    def show_state(self, status: Status) -> None:
        """Show a problem with the scanner for as long as it lasts."""
        self._notices.set_state(status.trouble)
        self._show()

    @Slot(str)
    def show_message(self, message: str) -> None:
        """Show a warning, unless there are errors. An empty message clears all."""
        if message:
            self._notices.add(message)
        else:
            self._notices.clear()
        self._show()

    @Slot(object)
    def show_notice(self, notice: Notice) -> None:
        """Show a notice, unless there are more severe ones."""
        self._notices.add(notice)
        self._show()

    @Slot(str)
    def show_error(self, message: str) -> None:
        """Show an error before all warnings."""
        self.show_notice(Notice(message, error=True))

    @Slot(str)
    def show_connection_error(self, message: str) -> None:
        """Show an error that ends when a scanner is connected."""
        self.show_notice(Notice(message, error=True, until=Until.CONNECTED))

    @Slot()
    def end_connection_errors(self) -> None:
        """Remove the errors of earlier attempts: a scanner is connected."""
        self._notices.end(Until.CONNECTED)
        self._show()

    @Slot(str)
    def show_search_error(self, message: str) -> None:
        """Show an error that ends when the scans or the scene of the search change."""
        self.show_notice(Notice(message, error=True, until=Until.SEARCH_CHANGED))

    @Slot()
    def end_search_errors(self) -> None:
        """Remove the errors of a search whose scans or scene have changed."""
        self._notices.end(Until.SEARCH_CHANGED)
        self._show()

    @Slot()
    def _show_next(self) -> None:
        self._notices.show_next()
        self._show()

    @Slot()
    def _accept(self) -> None:
        answer = self._notices.shown.accept_value
        self._dismiss()
        self.answered.emit(answer)

    @Slot()
    def _decline(self) -> None:
        answer = self._notices.shown.decline_value
        self._dismiss()
        self.answered.emit(answer)

    @Slot()
    def _dismiss(self) -> None:
        self._notices.dismiss()
        self._show()

    def _show(self) -> None:
        notice, more = self._notices.shown, self._notices.more
        self._label.setText(f"⚠ {notice.text}" if notice.text else "")
        for button, text in ((self.accept_button, notice.accept_text), (self.decline_button, notice.decline_text)):
            button.setText(text)
            button.setVisible(bool(text))
        self.more_button.setText(f"{more} more ▸")
        self.more_button.setVisible(more > 0)
        if notice.text:
            self.opened.emit(True)  # before it needs its place: Qt enlarges the window at once
            self.show()
        else:
            self.hide()
            self.opened.emit(False)
