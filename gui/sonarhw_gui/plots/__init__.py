"""Parts common to all plots: axes, marks, picking, and pictures of views."""
