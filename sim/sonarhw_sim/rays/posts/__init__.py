"""Paths by posts: every chain of up to three reflections, and how strongly a thin post reflects."""
