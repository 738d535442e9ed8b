"""The menu of named layouts: save the arrangement of views and panels under a name, use it again, delete it."""

from collections.abc import Mapping
from functools import partial

from PySide6.QtCore import QByteArray, Qt, Slot
from PySide6.QtWidgets import QInputDialog, QMainWindow, QMenu

from sonarhw_gui.dialogs.one_dialog import close_dialogs

Layout = tuple[QByteArray, QByteArray]  # panels of the window, and views, as Qt saves them


class LayoutMenu(QMenu):
    """Lists the layouts when it opens."""

    def __init__(self, window: QMainWindow, views: QMainWindow) -> None:
        super().__init__("Layouts", window)
        self._window, self._views = window, views
        self.layouts: dict[str, Layout] = {}
        self.dialog: QInputDialog | None = None
        self.deleting = QMenu("Delete layout", self)
        self.aboutToShow.connect(self.show_names)
        self.show_names()

    def restore(self, layouts: Mapping[str, Layout]) -> None:
        """Offer these layouts, as saved before."""
        self.layouts = dict(layouts)
        self.show_names()

    @Slot()
    def show_names(self) -> None:
        """List the layouts, and the commands that save and delete one."""
        self.clear()
        for name in sorted(self.layouts):
            self.addAction(_as_text(name)).triggered.connect(partial(self.use, name))
        self.addSeparator()
        self.addAction("Save layout…").triggered.connect(self._ask_name)
        self.addMenu(self.deleting)
        self.deleting.clear()
        self.deleting.setEnabled(bool(self.layouts))
        for name in sorted(self.layouts):
            self.deleting.addAction(_as_text(name)).triggered.connect(partial(self._delete, name))

    @Slot()
    def use(self, name: str) -> None:
        """Arrange views and panels as in a layout; a part that Qt refuses stays as it is."""
        panels, views = self.layouts[name]
        self._window.restoreState(panels)
        self._views.restoreState(views)

    @Slot()
    def _ask_name(self) -> None:
        close_dialogs(self._window)
        self.dialog = dialog = QInputDialog(self._window)
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.setWindowTitle("Save layout")
        dialog.setLabelText("Name of the layout; a layout with this name is replaced")
        dialog.textValueSelected.connect(self._save)
        dialog.show()

    @Slot(str)
    def _save(self, name: str) -> None:
        if name.strip():
            self.layouts[name.strip()] = self._window.saveState(), self._views.saveState()
            self.show_names()

    @Slot()
    def _delete(self, name: str) -> None:
        del self.layouts[name]


def _as_text(name: str) -> str:
    """Return a name as the text of an action, in which & marks a key."""
    return name.replace("&", "&&")
