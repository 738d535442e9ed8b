"""The menus and bars around the views: toolbar, banner and status bar."""
