"""What names of columns, keys and units mean: a quantity and a unit, in the languages of sketches."""

import math
import re
import unicodedata
from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import StrEnum

from sonarhw.sound_speed import speed_of_sound


class ColumnKind(StrEnum):
    """What a column of numbers contains."""

    ANGLE = "angle"
    RANGE = "range"
    TIME = "time"
    OTHER = "other"  # numbers of readings and sensors, temperatures
    UNSUPPORTED = "unsupported"  # takes the place of a range, as a voltage does


_ECHO_US = speed_of_sound() / 2 * 1e-6  # m of range for 1 µs of the echo time, at 20 °C
RANGE_UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048, "yd": 0.9144, "us": _ECHO_US}  # m
UNIT_NAMES = {
    "m": "metres",
    "cm": "centimetres",
    "mm": "millimetres",
    "in": "inches",
    "ft": "feet",
    "yd": "yards",
    "us": "microseconds of echo time",
    "deg": "degrees",
    "rad": "radians",
    "gon": "gradians",
    "step": "steps",
}
ANGLE_UNITS = {"deg": 1.0, "rad": math.degrees(1.0), "gon": 0.9}  # degrees; the size of a step is a setting
STEP = "step"  # the unit of an angle that is counted in steps


@dataclass(frozen=True)
class NameMeaning:
    """What a name says about its numbers."""

    quantity: ColumnKind | None = None  # None: unknown
    unit: str | None = None  # of RANGE_UNITS or ANGLE_UNITS, or STEP; None: not stated
    clockwise: bool = False
    word: str = ""  # that states the unit or the unsupported quantity, as written
    doubtful: tuple[str, ...] = ()  # units that the word may mean, if there are several


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


_METRIC_ANGLES = _words(  # of languages whose sketches print no inches, feet and yards
    "winkel richtung angulo angolo giro aci hoek kat kierunek ugol угол sudut 角度 角 direccion ugao"
)
_METRIC_RANGES = _words(
    "abstand distanz entfernung distancia distanza afstand uzaklik mesafe odleglosc dystans vzdalenost portee "
    "jarak расстояние дистанция 距离 距離 alcance reichweite avstand udaljenost"
)
_ANGLES = _METRIC_ANGLES | _words(
    "heading angle angles ang bearing azimuth theta servo pan yaw turret rotation position pos a"
)
_RANGES = _METRIC_RANGES | _words(
    "range ranges distance distances dist d r echo sonar ultrasonic ultrasound sonic length depth reading"
)
_ECHO_TIMES = _words("duration pulse pulsewidth tof flight pulso dauer duree sure")
_TIMES = _words(
    "time t ms s sec secs seconds millis timestamp stamp millisecond milliseconds zeit tiempo temps tempo zaman czas"
)
_OTHERS = _words(
    "n no nr num number index idx id i count counter seq sequence sample sensor sweep pass direction dir ping pings "
    "temp temperature humidity battery rssi quality strength speed light x y z lux status state flag conf confidence "
    "min max checksum crc bat version"
)
_UNSUPPORTED = _words("voltage volt volts v mv adc raw counts db dbm ma amps km mi miles bar kpa")
_RANGE_WORDS = {
    "m": "м 米 公尺 m meter meters metre metres metro metros metri metr mts mtr",
    "cm": "cm cms centimeter centimeters centimetre centimetres zentimeter centimetro centimetros centimetri "
    "santimetre см 厘米 公分",
    "mm": "mm millimeter millimeters millimetre millimetres milimetro milimetros millimetri milimetre milimeter "
    "мм 毫米",
    "in": 'in inch inches " pulgada pulgadas zoll pouce pouces pollici polegada polegadas inc inci cal cale duim',
    "ft": "ft foot feet ' pie pies fuss pied pieds piedi pes pe fit stopa",
    "yd": "yd yds yard yards yarda yardas jarda jardas iarda iarde",
    "us": "us usec usecs microsecond microseconds mikrosekunden microsegundos mikrosaniye microsecondes",
}
_ANGLE_WORDS = {
    "deg": "deg degs degree degrees ° º grados grado graus grau gradi derece degre degres graden stopnie "
    "stopni градусов град 度",
    "rad": "rad rads radian radians radianes radiant bogenmass radianti radyan",
    "gon": "gon gons gradian gradians grads",
    STEP: "step steps schritt schritte paso pasos passo passi adim pas stap stappen krok kroki microstep microsteps",
}
_OF_RANGES = {word: unit for unit, words in _RANGE_WORDS.items() for word in words.split()}
_OF_ANGLES = {word: unit for unit, words in _ANGLE_WORDS.items() for word in words.split()}
_CLOCKWISE = _words("cw clockwise")
_GERMAN = _words("winkel abstand entfernung distanz richtung messung zoll schritt zentimeter")
_LETTERS = str.maketrans({"ı": "i", "İ": "i", "ß": "ss", "ł": "l", "Ł": "l", "µ": "u", "μ": "u", "ø": "o", "″": '"'})
NO_ECHO = (
    *(
        "out of range",
        "out-of-range",
        "no echo",
        "none",
        "null",
        "nan",
        "inf",
        "-inf",
        "infinity",
        "timeout",
        "-",
        "--",
        "---",
    ),
    *(
        "fuera de rango",
        "sin eco",
        "kein echo",
        "ausser reichweite",
        "hors de portee",
        "fora de alcance",
        "menzil disi",
    ),
    *("n/a", "na", "no object", "error", "err", "oor", "clear", "fuori portata", "buiten bereik", "poza zasiegiem"),
)


class _PlainCharacters(dict[int, str]):
    """What stands for a character of another script."""

    def __missing__(self, code: int) -> str:
        character = chr(code)
        category = unicodedata.category(character)
        plain = character
        if category[0] == "Z":
            plain = " "
        elif category == "Cf":  # invisible, such as marks of the direction of writing
            plain = ""
        elif category == "Nd":
            plain = str(unicodedata.decimal(character))
        elif 0xFF01 <= code <= 0xFF5E:  # as wide as a Chinese character
            plain = chr(code - 0xFEE0)
        return self.setdefault(code, plain)


_PLAIN = _PlainCharacters({ord("\u2212"): "-", ord("\u066b"): ".", ord("\u066c"): ",", ord("\u060c"): ","})


def plain_text(text: str) -> str:
    """Return a text with the spaces, digits and marks of ASCII in place of those of other scripts."""
    return text if text.isascii() else text.translate(_PLAIN)


def folded(text: str) -> str:
    """Return a text in lower case without accents."""
    plain = unicodedata.normalize("NFKD", text.translate(_LETTERS))
    return "".join(char for char in plain if not unicodedata.combining(char)).lower()


def words_of(name: str) -> list[str]:
    """Return the words in a name, in lower case and without accents: `rangeMm` has two."""
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    return re.findall(r'[^\W\d_]+|[°º"]', folded(spaced).replace("º", "°"))


def unit_of_word(word: str, german: bool = False) -> NameMeaning:
    """Return the quantity and unit that a word after a number states; nothing for an unknown word.

    The German `Grad` is a degree, the English `grad` a gradian.
    """
    plain = folded(word).strip("()[].")
    if plain == "grad":
        unit = "deg" if german else None
        return NameMeaning(ColumnKind.ANGLE, unit, word=word, doubtful=() if german else ("deg", "gon"))
    if plain in _OF_RANGES:
        return NameMeaning(ColumnKind.RANGE, _OF_RANGES[plain], word=word)
    if plain in _OF_ANGLES:
        return NameMeaning(ColumnKind.ANGLE, _OF_ANGLES[plain], word=word)
    if plain in _UNSUPPORTED:
        return NameMeaning(ColumnKind.UNSUPPORTED, word=word)
    return NameMeaning()


def meaning_of(name: str, german: bool = False) -> NameMeaning:
    """Return what a name of a column or key says. Its first word is the quantity, one of the others the unit."""
    words = words_of(name)
    if not words:
        return NameMeaning()
    first, clockwise = words[0], bool(_CLOCKWISE & set(words))
    units = [unit for word in words[1:] if (unit := unit_of_word(word, german)).quantity is not None]
    quantity = _quantity(first)
    if len(words) > 1 and (quantity is None or first == "sensor"):
        quantity = _quantity(words[1]) or quantity  # "front distance"
    alone = unit_of_word(first, german)
    if quantity is None:  # the unit alone, such as "cm" or "Inches"
        return replace(alone, clockwise=clockwise) if alone.quantity else _unsupported(units)
    # the last one: "Distance in cm"
    stated = next((unit for unit in reversed(units) if unit.quantity in (quantity, ColumnKind.UNSUPPORTED)), None)
    if quantity is ColumnKind.RANGE and first in _ECHO_TIMES and stated is None:
        return NameMeaning(quantity, None, clockwise, first, ("us",))
    if quantity is ColumnKind.UNSUPPORTED:
        return NameMeaning(quantity, word=first)
    if stated is None:
        return NameMeaning(quantity, None, clockwise)
    if stated.quantity is ColumnKind.UNSUPPORTED and quantity is ColumnKind.RANGE:
        return stated
    return NameMeaning(quantity, stated.unit, clockwise, stated.word, stated.doubtful)


def _unsupported(units: list[NameMeaning]) -> NameMeaning:
    return next((unit for unit in units), NameMeaning())


def _quantity(word: str) -> ColumnKind | None:
    if word in _ECHO_TIMES:
        return ColumnKind.RANGE
    for quantity, names in (
        (ColumnKind.ANGLE, _ANGLES),
        (ColumnKind.RANGE, _RANGES),
        (ColumnKind.TIME, _TIMES),
        (ColumnKind.OTHER, _OTHERS),
        (ColumnKind.UNSUPPORTED, _UNSUPPORTED),
    ):
        if word in names:
            return quantity
    return None


def is_range_word(word: str) -> bool:
    """Return whether a word names a range, in lower case and without accents."""
    return word in _RANGES


_OF_TIMES = {
    **dict.fromkeys(_words("s sec secs second seconds sekunden segundos secondes"), 1.0),
    **dict.fromkeys(_words("ms millis millisecond milliseconds msec millisekunden milisegundos"), 1e-3),
}


def time_unit(name: str) -> float | None:
    """Return the unit, s, that the name of a column of times states; None without one."""
    return next((_OF_TIMES[word] for word in reversed(words_of(name)) if word in _OF_TIMES), None)


def is_german(words: Iterable[str]) -> bool:
    """Return whether one of these words is a German one of such texts."""
    return any(folded(word) in _GERMAN for word in words)


def metric_word(words: Iterable[str]) -> str | None:
    """Return the first word of a language whose sketches print no inches, feet and yards."""
    return next((word for word in words if folded(word) in _METRIC_ANGLES | _METRIC_RANGES), None)


def is_no_echo(text: str) -> bool:
    """Return whether a text in place of a range means no echo."""
    return folded(text).strip(" .!") in NO_ECHO
