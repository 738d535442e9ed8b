"""The device side of the protocol: fake and emulated boards, their faults, and the ports that serve them.

An Endpoint serves a Device on a ServerPort. ProtocolDevice answers commands; FakeBoard and the replay of a log (in
sonarhw.replay) implement its actions. A FaultyDevice (in faults) is a fake board with a bad line, resets or silence.
"""
