"""The room model, its file format and its geometry."""
