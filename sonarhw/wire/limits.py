"""Version, sizes and times of the wire protocol.

`firmware/generate.py` writes all of them to the firmware's `messages.h`. Times there are in µs, with the suffix `_US`.
"""

PROTOCOL_MAJOR = 1
PROTOCOL_MINOR = 2

# sizes
FIRST_BAUD = 250_000  # baud rate after every start of a device; exact with a clock of 16 MHz
MAX_PAYLOAD = 512  # bytes
MAX_ECHOES = 122  # echoes of one reading; more do not fit into a payload
MAX_TEXT = 60  # bytes of each text in Info
MAX_TEST = 64  # bytes of a TestLink
MAX_TESTED = 480  # bytes of a LinkTested
CHUNK = 256  # bytes of samples in a TraceChunk
MOST_HEADINGS = 0xFFFF  # headings of one sweep; StartScan counts them in u16
MOST_SWEEPS = 0xFFFF  # sweeps of one scan; StartScan counts them in u16
LONGEST_TRACE = 0xFFFF  # samples of one trace
MOST_READINGS = 0xFFFF_FFFF  # readings of one scan; Started and Finished count in u32
RECEIVE_ROOM = 127  # bytes from the host that a device keeps while it listens or sends; more are lost
KEPT_READINGS = 64  # readings that a device of version 1.0 keeps for Resend

# times of a device, s
HEARTBEAT = 0.250  # interval between heartbeats
HOST_SILENCE = 2.0  # time without a valid frame; the device then releases the motor and waits for Hello
BAUD_TIMEOUT = 0.5  # time without a valid frame at a new baud rate; the device then returns to the previous one
