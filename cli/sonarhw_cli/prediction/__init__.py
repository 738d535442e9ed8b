"""Commands that predict scans."""
