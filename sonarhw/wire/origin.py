"""The origin of readings: measured by a scanner, or not.

The origin follows from the program that wrote a log and from the identity of its device. Both are in every log, so old
logs have an origin too. A replayed log reports its recorded identity, so a scan of a replay has the origin of that log.
"""

from sonarhw.readings import Origin

FAKE_FIRMWARE = "sonarhw-fake"  # first word in the firmware of a fake scanner
EMULATED_SERIAL = "EMULATED"  # serial number of the emulated board
_WRITER = "sonarhw {}"  # start of the firmware in a log that a command wrote without a scanner
_BY_WRITER = {"simulate": Origin.SIMULATED, "import": Origin.IMPORTED}


def origin_of(made_by: str, firmware: str, serial: str) -> Origin:
    """Return the origin of the readings in a log, from its writer and the identity of its device."""
    for writer, origin in _BY_WRITER.items():
        if made_by == writer or firmware.startswith(_WRITER.format(writer)):
            return origin
    if firmware.startswith(FAKE_FIRMWARE) or serial == EMULATED_SERIAL:
        return Origin.FAKE
    return Origin.MEASURED
