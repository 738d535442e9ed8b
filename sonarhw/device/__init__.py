"""The device side of the protocol: fake and emulated boards, their faults, and the ports that serve them."""
