"""Strength of diffraction: one wedge, and the two wedges at the ends of a narrow wall."""
