"""What a scanner is used for: record a scan in a log, and calibrate range offset and home angle with a plate."""
