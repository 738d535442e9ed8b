"""Work for worker threads: prediction, comparison, B-scan, fit, ports."""
