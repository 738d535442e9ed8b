"""Work in the background of the window: predictions, traces, searches and files."""
