"""The application, its main window and the bars around the views."""
