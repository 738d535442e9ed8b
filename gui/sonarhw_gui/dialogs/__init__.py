"""The dialogs of the window. None is modal, and one is open at a time."""
