"""Commands that drive a scanner or read and write its logs."""
