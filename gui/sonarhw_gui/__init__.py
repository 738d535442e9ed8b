"""The window of sonarhw (PySide6, pyqtgraph). Open it with `sonarhw gui`.

This package has no public names: all modules belong to the application and may change.
"""
