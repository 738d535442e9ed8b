"""The words of other programs for what commands and options of this one do."""

import re
from collections.abc import Sequence
from typing import Any, NamedTuple

# by the command that does this
_OTHER_WORDS = {
    "compare": "analyse analyze check-scan explain match why",
    "compare A.mcap --with B.mcap": "diff difference differences",
    "compare LOG --plot PICTURE": "plot overlay",
    "doctor": "diagnose selftest self-test test",
    "fake": "emulate emulator mock simulator virtual",
    "fit": "adjust optimise optimize",
    "flash": "build burn compile firmware install program update upgrade upload",
    "gui": "chart display draw edit graph live load open show view viewer visualise visualize window",
    "home": "reset zero",
    "import": "bag convert rosbag",
    "info": "connect settings status",
    "locate": "find localisation localise localization localize pose position",
    "log export": "csv dump extract save",
    "log info": "describe inspect statistics stats summary",
    "map": "combine find-room merge slam",
    "monitor": "debug echo listen minicom miniterm putty screen sniff tail terminal topic watch",
    "ports": "config configure detect devices discover list search serial setup",
    "ports --guess": "arduino guess identify radar sketch",
    "profile list": "boards profiles sensors",
    "replay": "play playback",
    "room list": "rooms",
    "room new": "init",
    "scan": "acquire capture collect get measure read record run start sweep",
    "serve": "broadcast foxglove publish ros stream websocket",
    "simulate": "predict raycast raytrace render",
    "stop": "abort halt",
    "track": "amcl mcl odometry",
    "turn": "move pan rotate",
    "--version": "version",
}
COMMANDS = {other: command for command, others in _OTHER_WORDS.items() for other in others.split()}
ANY = ("get", "list", "new", "run", "show", "start")  # words that are joined with what is wanted
# within a group such as `sonarhw room`
COMMANDS_OF_GROUPS = {
    "check": "describe draw info plot print show validate view",
    "export": "convert csv dump save",
    "import": "convert",
    "info": "check describe print show stats view",
    "list": "ls",
    "new": "add clone copy create edit import init make",
    "recover": "fix repair",
}


class _Instead(NamedTuple):
    """What to write in place of options of other programs."""

    text: str  # it applies to commands with the options that it names
    words: str
    argument: str = ""  # the command needs one whose name contains this
    option: str = ""  # as well as this option


_POSITION = "initial initial-pose location pos pose position start-pose xy"
_HEADING = "angle azimuth bearing dir direction heading orientation theta yaw"
_READ = "csv-file data file filename i in infile input log scan"
# the first that applies to the command is printed
_OTHER_OPTIONS = (
    _Instead(
        "an existing file is never overwritten: choose another name, or delete it",
        "f force overwrite replace y yes",
        "NAME.TOML",
    ),
    _Instead("`sonarhw ports` lists the scanners", "detect devices discover list list-ports ports search", "URL"),
    _Instead("--guess tries the usual baud rates", "baud baudrate b rate speed", "PORT"),
    _Instead("without an option, `sonarhw ports` lists all", "a all l list", "PORT", option="--guess"),
    _Instead("the rate stands in the URL: `'lines:/dev/ttyUSB0?baud=9600&preset=NAME'`", "baud baudrate b", "URL"),
    _Instead(
        "the scanner sets the time from ping to ping, which `sonarhw info URL` prints",
        "delay fps hz period rate",
        "URL",
    ),
    _Instead(
        "its address is --tcp HOST:PORT; the URL of the scanner stands without an option before it",
        "address host listen p port",
        "URL",
    ),
    _Instead(
        "a fake scanner is a URL: 'fake:ROOM?place=NAME'",
        "emulate emulator fake mock sim simulate simulated simulator virtual",
        "URL",
    ),
    _Instead(
        "the URL of the scanner stands without an option before it, such as /dev/ttyUSB0 or COM3",
        "address com device host p port scanner serial tty url",
        "URL",
    ),
    _Instead(
        "the port of the controller stands without an option before it, such as /dev/ttyACM0 or COM3",
        "address com device p port serial tty url usb",
        "PORT",
        "--controller",
    ),
    _Instead("the firmware is included", "file firmware hex image sketch", option="--ranging"),
    _Instead("the controller is --controller, such as --controller uno", "arduino board fqbn mcu target"),
    _Instead("the ranging board is --ranging, such as --ranging hc-sr04", "ranger rangefinder sensor ultrasonic"),
    _Instead("the turntable is --turning, such as --turning servo", "motor stepper turntable"),
    _Instead("its address is --tcp HOST:PORT", "address host listen p port url"),
    _Instead(
        "the unit of a file is an option of `sonarhw import`; that of a device stands in the URL: "
        "`'lines:/dev/ttyUSB0?preset=NAME&unit=cm'`",
        "unit units",
        "SCAN",
    ),
    _Instead("the preset stands in the URL: `lines:/dev/ttyUSB0?preset=NAME`", "format layout pattern preset", "URL"),
    _Instead("the noise of the receiver is --noise", "sd sigma std snr"),
    _Instead("the model is --model", "algorithm method mode"),
    _Instead(
        "the headings of a scan are --from, --to and --step, in degrees",
        "angles beams begin degrees delta end fov headings increment interval max-angle min-angle rays "
        "resolution sector start stop width",
    ),
    _Instead("the angle between readings is --step, in degrees", "angle-step increment resolution"),
    _Instead("the number of pings is --count", "c n number pings repeat samples times"),
    _Instead(
        "the number of sweeps is --sweeps",
        "count duration loops minutes n number repeat repeats rounds scans seconds time times turns",
    ),
    _Instead("the air stands in the room file, in the table [air]", "air humidity temp temperature", "ROOM"),
    _Instead(
        "the log contains the speed of sound of its scan, and the room file the air, in the table [air]",
        "air humidity speed-of-sound temp temperature",
        "LOG",
        "--receiver",
    ),
    _Instead("the unit stands in the URL: `'lines:/dev/ttyUSB0?preset=NAME&unit=cm'`", "unit units", "URL"),
    _Instead("pings at each heading are --pings", "average averages mean repetitions samples shots"),
    _Instead(
        "all paths are listed, the shortest first; --max-range and --max-bounces leave out others",
        "count first head limit max-paths n num number paths shortest top",
        option="--faintest",
    ),
    _Instead("the farthest range is --max-range, in metres", "distance limit max-dist max-distance maximum range"),
    _Instead("the time for reconnecting is --reconnect, in seconds", "timeout wait"),
    _Instead(
        "each reading is printed with its heading, such as `sonarhw compare LOG | grep 270.0`",
        f"at filter reading readings select {_HEADING}",
        option="--find-missing",
    ),
    _Instead("`sonarhw turn URL DEG` turns to an angle before it", _HEADING, "URL", option="--count"),
    _Instead(
        "paths at all headings lead from --place back to it",
        f"angles end from goal receiver sector source start step stop target to {_HEADING}",
        option="--faintest",
    ),
    _Instead(
        "the headings of a scan are --from, --to and --step; that of the sensor is the third number of --place X,Y,DEG",
        _HEADING,
    ),
    _Instead("the heading is the third number of --place X,Y,DEG", _HEADING),
    _Instead("reflections are --max-bounces", "bounces order reflections"),
    _Instead("all reflections that the board can detect are followed", "bounces max-bounces order reflections", "ROOM"),
    _Instead("the other scan is --with LOG", "against baseline log2 other reference second"),
    _Instead("what --free does not name is fixed", "constant fix fixed hold keep"),
    _Instead("the speed is --speed, such as --speed 2", "factor fast pace rate"),
    _Instead("the speed is --pace, such as --pace 10 or --pace max", "factor fast rate realtime slow speed"),
    _Instead("the protocol is --foxglove", "http mqtt protocol ros ros2 rosbridge udp websocket ws"),
    _Instead("it is served with --pty LINK or --tcp HOST:PORT", "com device link serial socket tty"),
    _Instead("the direction of the angle 0 is --heading-zero", "angle-offset offset rotate rotation shift zero"),
    _Instead(
        "no reading is left out; the range that means no echo is --no-echo",
        "clip cutoff filter limit max max-distance median min min-distance min-range outliers smooth",
    ),
    _Instead("the range that means no echo is --no-echo", "inf invalid max-range missing na nan none null"),
    _Instead("the speed of sound is --speed-of-sound", "air c sound-speed temp temperature"),
    _Instead("clockwise is a negative --step, such as --from 360 --to 0 --step -5", "ccw clockwise cw flip reverse"),
    _Instead("the room file contains it", "absorption material materials reflectance wall walls", "ROOM"),
    _Instead("clockwise angles are --turn cw", "clockwise cw flip invert reverse"),
    _Instead(
        "the columns are --heading NAME and --range NAME",
        "angle angle-col angle-column angles column columns cols dist distance distances",
    ),
    _Instead(
        "the unit of the ranges is --unit, such as --unit cm", "cm ft in inches m mm range-unit", option="--scale"
    ),
    _Instead("the unit of the angles is --angle, such as --angle rad", "angle-unit angles-in deg degrees rad radians"),
    _Instead(
        "separators and lines before the header are recognised",
        "delimiter header sep separator skip skip-header skip-rows skiprows",
        option="--decimal-comma",
    ),
    _Instead(
        "the quantities to fit are --free, such as --free heading",
        "fit param params parameter parameters optimise optimize variables vary",
    ),
    _Instead(
        "the odometry is the poses in the log; `sonarhw import` reads them from a file",
        "odom odometry path poses trajectory",
        option="--start",
    ),
    _Instead(
        "the demo has a room and a place of its own; `sonarhw gui 'fake:ROOM?place=NAME'` shows another",
        "board pace place room scanner seed url",
        option="--headless",
    ),
    _Instead(
        "the window writes pictures with Ctrl+P; without it, `sonarhw compare` draws them, and `sonarhw report` writes "
        "a report",
        "export html o out output pdf picture plot png report save",
        "LOG|SCAN|URL|ROOM",
    ),
    _Instead("the start is --start NAME or --start X,Y,DEG", f"at near place {_POSITION}"),
    _Instead("the place of the sensor is --place NAME or --place X,Y,DEG", f"at sensor-position x y {_POSITION}"),
    _Instead(
        "the whole room is searched; `sonarhw fit` starts from a known place",
        f"at guess place start {_POSITION}",
        option="--heading-sd",
    ),
    _Instead("the room stands without an option before it", "env environment map plan room world", "ROOM"),
    _Instead("the room is --room NAME or --room FILE.toml", "env environment map plan world"),
    _Instead("the board is --board NAME or --board FILE.toml", "device-profile profile transducer"),
    _Instead(
        "the board profile contains it; --board FILE.toml",
        "aperture beam beamwidth blanking freq frequency gain max-dist max-distance max-range range threshold",
    ),
    _Instead("its size is --size WxD in metres, such as --size 3.2x2.4", "depth dimensions height length width"),
    _Instead(
        "the window has a command for this",
        "calibrate compare explain fit live locate play predict record replay scan simulate",
        "LOG|SCAN|URL|ROOM",
    ),
    _Instead("the room that is found is written with --out ROOM.toml", "find find-room", option="--next"),
    _Instead("a reading matches within 5 cm, which is fixed", "accuracy tol tolerance within", option="--find-missing"),
    _Instead("the draws for the credible intervals are --samples", "chains draws iterations mcmc n steps"),
    _Instead("processes are --workers N", "cores j jobs n-jobs processes threads"),
    _Instead("an existing file is replaced with --force", "f overwrite replace y yes"),
    _Instead("`sonarhw gui` opens it in the window", "display show view", "LOG"),
    _Instead("a picture is --plot FILE.png", "o out output"),
    _Instead(
        "without a window, the files are written with --headless DIR", "gui no-gui nogui o out output save window"
    ),
    _Instead("the ending of --out chooses what is written", "format"),
    _Instead("the file stands without an option before it", f"name o out output save to {_READ}", "NAME.TOML"),
    _Instead("the name of the file stands without an option before it", _READ, "LOG"),
    _Instead("the name of the file stands without an option before it", _READ, "FILE"),
    _Instead("the file to write is --out", "file filename log o record save save-as to write"),
)
FORMATS = ["csv", "gif", "html", "jpg", "json", "mat", "mcap", "mp4", "npz", "pdf", "png", "svg", "txt", "xlsx", "yaml"]
SAVE = ("o", "out", "output", "outfile", "save", "to")
PICTURES = ("chart", "draw", "figure", "graph", "image", "picture", "plot", "save-plot")
# options that stand before the command
GLOBAL = {
    "debug": "--verbose",
    "quiet": "--quiet",
    "q": "-q",
    "silent": "--quiet",
    "v": "--verbose",
    "verbose": "--verbose",
}
# words for what the help of options calls otherwise
WORDS_OF_HELP = {
    **dict.fromkeys(("sd", "sigma", "std", "stdev", "uncertainty"), "standard deviation"),
    **dict.fromkeys(("azimuth", "bearing", "theta", "yaw"), "heading"),
    **dict.fromkeys(("distance", "depth"), "range"),
    **dict.fromkeys(("animate", "animation", "movie", "video"), "film"),
    "scale": "unit",
    **dict.fromkeys(("continuous", "endless", "follow", "forever", "live", "stream", "tail"), "Ctrl-C"),
    **dict.fromkeys(("clobber", "replace"), "overwrite"),
}


def instead_of(word: str, parameters: Sequence[Any]) -> str:
    """Return what a command with these parameters expects in place of an option of other programs, or nothing."""
    names = {name for parameter in parameters for name in parameter.opts}
    given = " ".join(str(p.metavar or p.name).upper() for p in parameters if p.param_type_name == "argument")
    for instead in _OTHER_OPTIONS:
        needed = {*re.findall(r"--[a-z-]+", f"{instead.text} {instead.option}")}
        if word in instead.words.split() and instead.argument in given and needed <= names:
            return instead.text
    return ""
