"""The views of a scan: plan, ranges, traces, B-scan and tables."""
