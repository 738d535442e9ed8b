"""The panels beside the views, and the replay bar."""
