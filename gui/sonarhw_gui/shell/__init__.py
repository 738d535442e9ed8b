"""The application, its main window, the views and docks in it, and their connections to the session."""
