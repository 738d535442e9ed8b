"""The connect dialog: the ports of this computer and a field for any other URL. Not modal."""

from collections.abc import Sequence

from PySide6.QtCore import QModelIndex, Qt, Signal, Slot
from PySide6.QtWidgets import (
    QAbstractItemView,
    QComboBox,
    QDialog,
    QDialogButtonBox,
    QHBoxLayout,
    QHeaderView,
    QLineEdit,
    QPushButton,
    QTableWidget,
    QTableWidgetItem,
    QVBoxLayout,
    QWidget,
)

from sonarhw_gui.parts.plain_label import PlainLabel, plain_tip
from sonarhw_gui.work.port_list import PortRow

_EXAMPLES = (
    "/dev/ttyUSB0, COM3, socket://HOST:PORT, rfc2217://HOST:PORT, fake:ROOM?place=NAME, "
    "or lines:PORT?preset=arduino-radar"
)


class ConnectDialog(QDialog):
    """Dialog to choose a scanner."""

    chosen = Signal(str)  # URL
    refreshed = Signal()  # list the ports again
    probe_all_requested = Signal()
    listen_requested = Signal(str)  # port

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.setWindowTitle("Connect a scanner")
        self._rows: tuple[PortRow, ...] = ()
        self.ports = _port_table()
        self.none = PlainLabel("No serial port found. Plug in the scanner and press Refresh, or enter a URL.")
        self.none.setWordWrap(True)
        self.refresh, self.probe_all = QPushButton("Refresh"), QPushButton("Check all ports")
        self.probe_all.setToolTip("Opening a port may reset the device on it")
        self.listen = QPushButton("Listen for text")
        self.listen.setToolTip("Find out what an Arduino radar or another device prints at the port below")
        self.field = QLineEdit(placeholderText=_EXAMPLES)
        self.url = QComboBox(editable=True, insertPolicy=QComboBox.InsertPolicy.NoInsert)
        self.url.setToolTip(_EXAMPLES)
        self.url.setLineEdit(self.field)
        # with selected text, Return would replace a proposed URL by an earlier one
        self.url.setCompleter(None)  # type: ignore[arg-type]  # the stub does not know that None is allowed
        self.buttons = QDialogButtonBox()
        self.connect_button = self.buttons.addButton("Connect", QDialogButtonBox.ButtonRole.AcceptRole)
        self.buttons.addButton(QDialogButtonBox.StandardButton.Cancel)
        self._lay_out()
        self._connect()
        self.resize(640, 340)
        self._update_button()

    def show_ports(self, rows: Sequence[PortRow]) -> None:
        """List the ports; the selection does not change."""
        self._rows, chosen = tuple(rows), self.url.currentText()
        self.ports.setRowCount(len(rows))
        for k, row in enumerate(rows):
            for column, text in enumerate((row.device, row.description, row.answer)):
                item = QTableWidgetItem(text)
                item.setToolTip(plain_tip(text))
                self.ports.setItem(k, column, item)
        self.none.setVisible(not rows)
        self.ports.setVisible(bool(rows))
        self.probe_all.setEnabled(any(row.answer == "not checked" for row in rows))
        proposed = {row.device: row.proposed_url for row in rows if row.proposed_url}
        if chosen in proposed:
            self.url.setEditText(proposed[chosen])
        answering = [row.device for row in rows if row.answers]
        if not chosen and len(answering) == 1:
            self.url.setEditText(answering[0])
        self._select(self.url.currentText(), rows)

    def show_urls(self, urls: Sequence[str]) -> None:
        """List URLs that were used before; the entered text does not change."""
        text = self.url.currentText()
        self.url.clear()
        self.url.addItems(list(urls))
        self.url.setEditText(text)

    def _select(self, url: str, rows: Sequence[PortRow]) -> None:
        row = next((k for k, row in enumerate(rows) if url in (row.device, row.proposed_url)), -1)
        if row >= 0:
            self.ports.selectRow(row)

    def _lay_out(self) -> None:
        beside = QHBoxLayout()
        beside.addWidget(self.refresh)
        beside.addWidget(self.probe_all)
        beside.addWidget(self.listen)
        beside.addStretch(1)
        column = QVBoxLayout(self)
        column.addWidget(self.none)
        column.addWidget(self.ports, stretch=1)
        column.addLayout(beside)
        column.addWidget(PlainLabel("Port or URL"))
        column.addWidget(self.url)
        column.addWidget(self.buttons)

    def _connect(self) -> None:
        self.ports.clicked.connect(self._take_row)
        self.ports.doubleClicked.connect(self._choose_row)
        self.url.editTextChanged.connect(self._update_button)
        self.refresh.clicked.connect(self.refreshed)
        self.probe_all.clicked.connect(self.probe_all_requested)
        self.listen.clicked.connect(self._listen)
        self.buttons.accepted.connect(self._choose)
        self.buttons.rejected.connect(self.close)

    @Slot(QModelIndex)
    def _take_row(self, index: QModelIndex) -> None:
        row = self._rows[index.row()]
        self.url.setEditText(row.proposed_url or row.device)

    @Slot(QModelIndex)
    def _choose_row(self, index: QModelIndex) -> None:
        self._take_row(index)
        self._choose()

    @Slot()
    def _choose(self) -> None:
        url = self.url.currentText().strip()
        if url:
            self.close()
            self.chosen.emit(url)

    @Slot()
    def _listen(self) -> None:
        self.listen_requested.emit(self.url.currentText().strip())

    @Slot()
    def _update_button(self) -> None:
        url = self.url.currentText().strip()
        self.connect_button.setEnabled(bool(url))
        self.listen.setEnabled(bool(url) and "://" not in url and "?" not in url)
        self.connect_button.setDefault(True)


def _port_table() -> QTableWidget:
    table = QTableWidget(0, 3)
    table.setHorizontalHeaderLabels(["port", "device", "answer"])
    table.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
    table.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
    table.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
    table.verticalHeader().hide()
    for column in (0, 1):
        table.horizontalHeader().setSectionResizeMode(column, QHeaderView.ResizeMode.ResizeToContents)
    table.horizontalHeader().setStretchLastSection(True)
    return table


def open_connect_dialog(parent: QWidget) -> ConnectDialog:
    """Return a dialog that is deleted when it is closed."""
    dialog = ConnectDialog(parent)
    dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    return dialog
