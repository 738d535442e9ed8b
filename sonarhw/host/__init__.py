"""The host side of the protocol: driver, session and scanner."""
