"""The banner: a line over the views for what went wrong, until it is put away, is over, or a new scan begins.

Takes messages and how things stand; hands on what somebody takes up of what is offered there. Never a dialog: the scan
goes on underneath.
"""

from PySide6.QtCore import Signal, Slot
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QPushButton, QSizePolicy, QToolButton

from sonarhw_gui.live.window_status import Status
from sonarhw_gui.look.appearance import Look
from sonarhw_gui.shown.notices import Notice, Notices


class Banner(QFrame):
    """Hidden where there is nothing to say."""

    taken = Signal(object)  # the answer of an offer, or of its refusal

    def __init__(self) -> None:
        super().__init__()
        self.setObjectName("banner")
        self._notices = Notices()
        self._label = QLabel()
        self._label.setWordWrap(True)
        self._label.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        self._behind = QLabel()
        self.offer_button = QPushButton()
        self.offer_button.clicked.connect(self._take)
        self.refusal_button = QPushButton()
        self.refusal_button.clicked.connect(self._refuse)
        self.close_button = QToolButton(autoRaise=True)
        self.close_button.setText("×")
        self.close_button.setToolTip("Put this message away")
        self.close_button.clicked.connect(self._put_away)
        row = QHBoxLayout(self)
        row.setContentsMargins(10, 4, 6, 4)
        row.addWidget(self._label)
        row.addWidget(self.offer_button)
        row.addWidget(self.refusal_button)
        row.addWidget(self._behind)
        row.addWidget(self.close_button)
        self.hide()

    @property
    def message(self) -> str:
        """What it says; empty where it is hidden."""
        return self._label.text() if not self.isHidden() else ""

    def show_look(self, look: Look) -> None:
        """Draw in the colours of this look."""
        ink, paper = look.palette.warning_ink, look.palette.warning_paper
        self.setStyleSheet(
            f"#banner {{ background: {paper}; }} #banner QLabel, #banner QToolButton {{ color: {ink}; }}"
        )

    def show_state(self, status: Status) -> None:
        """Say what stands in the way now, for as long as it does."""
        self._notices.stand(status.trouble)
        self._show()

    @Slot(str)
    def tell(self, message: str) -> None:
        """Say it, behind what has not been put away yet; nothing to say puts all away."""
        if message:
            self._notices.tell(message)
        else:
            self._notices.forget()
        self._show()

    @Slot(object)
    def offer(self, notice: Notice) -> None:
        """Say it, with a button for what can be done about it."""
        self._notices.tell(notice)
        self._show()

    @Slot()
    def _take(self) -> None:
        answer = self._notices.first.answer
        self._put_away()
        self.taken.emit(answer)

    @Slot()
    def _refuse(self) -> None:
        refused = self._notices.first.refused
        self._put_away()
        self.taken.emit(refused)

    @Slot()
    def _put_away(self) -> None:
        self._notices.put_away()
        self._show()

    def _show(self) -> None:
        notice, behind = self._notices.first, self._notices.behind
        self._label.setText(f"⚠ {notice.text}" if notice.text else "")
        for button, says in ((self.offer_button, notice.offer), (self.refusal_button, notice.refusal)):
            button.setText(says)
            button.setVisible(bool(says))
        self._behind.setText(f"{behind} more" if behind else "")
        self.setVisible(bool(notice.text))
