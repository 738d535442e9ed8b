"""The fit of the scanner's pose: a request to a thread, a state, an edit of the scene, and the panel."""
