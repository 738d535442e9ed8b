"""The device side of the protocol: fake boards, faults, and serving them on a port."""
