"""The numbers that the wire protocol fixes: its version, sizes and times.

`firmware/generate.py` writes all of them into the firmware's `messages.h`; a time there has the suffix `_US`.
"""

PROTOCOL_MAJOR = 1
PROTOCOL_MINOR = 1

# sizes
FIRST_BAUD = 250_000  # after every start of a device; exact on a chip of 16 MHz
MAX_PAYLOAD = 512  # bytes
MAX_ECHOES = 122  # of one reading; more do not fit a payload
MAX_TEXT = 60  # bytes of each text in Info
MAX_TEST = 64  # bytes of a TestLink
MAX_TESTED = 480  # bytes of a LinkTested
CHUNK = 256  # bytes of samples in a TraceChunk
MOST_READINGS = 0xFFFF_FFFF  # of one scan: Started and Finished count in u32
KEPT_READINGS = 64  # that a device of version 1.0 holds ready to be sent again

# times of a device, s
HEARTBEAT = 0.250  # from one Heartbeat to the next
HOST_SILENCE = 2.0  # without an undamaged frame; then the device releases the motor and waits for a Hello
UNHEARD = 0.5  # without an undamaged frame at a new speed of the line; then the device returns to the old speed
