"""The command that prints the large view, with a preview."""

from collections.abc import Callable

from PySide6.QtCore import QObject, QRect, Qt, Slot
from PySide6.QtGui import QImage, QPageLayout, QPainter
from PySide6.QtPrintSupport import QPrinter, QPrintPreviewDialog
from PySide6.QtWidgets import QWidget

from sonarhw_gui.commands.command_list import Commands
from sonarhw_gui.dialogs.one_dialog import close_dialogs

_RESOLUTION = 300  # dots per inch


class PrintCommand(QObject):
    """Prints the picture that *Copy picture* copies, as large as the page allows."""

    def __init__(self, commands: Commands, picture: Callable[[], QImage | None], window: QWidget) -> None:
        """`picture`: returns the picture of the large view; None if it has none."""
        super().__init__(window)
        self._window, self._picture = window, picture
        self._image = QImage()
        self.preview: QPrintPreviewDialog | None = None
        commands.print_view.triggered.connect(self._show_preview)

    @Slot()
    def _show_preview(self) -> None:
        image = self._picture()
        if image is None:
            return
        self._image = image
        close_dialogs(self._window)
        # the dialog owns its printer; one of our own would be freed before a preview that is closed at once
        self.preview = dialog = QPrintPreviewDialog(self._window)
        dialog.printer().setResolution(_RESOLUTION)
        dialog.printer().setPageOrientation(QPageLayout.Orientation.Landscape)
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.setWindowTitle("Print")
        dialog.paintRequested.connect(self.draw)
        dialog.show()

    @Slot(QPrinter)
    def draw(self, printer: QPrinter) -> None:
        """Draw the picture on the page."""
        with QPainter(printer) as painter:
            page = painter.viewport()
            size = self._image.size().scaled(page.size(), Qt.AspectRatioMode.KeepAspectRatio)
            painter.drawImage(QRect(page.topLeft(), size), self._image)
