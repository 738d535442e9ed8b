"""The instrument: readings and scans, wire protocol, driver, fake scanner, logs, replay."""
