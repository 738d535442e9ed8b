"""Scanners by URL: a port, a fake scanner in this process, or a log that is replayed as a scanner."""
