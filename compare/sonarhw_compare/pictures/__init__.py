"""Pictures of scans: overlay, B-scan, colours."""
