"""What all plots share: axes, marks, picking and export as a picture."""
