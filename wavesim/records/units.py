"""Units of times and positions, as files and people spell them, and positions in headings."""

from __future__ import annotations

import re
from collections.abc import Sequence

Said = tuple[float, str | None]
"""A position that a heading says, and its unit; None where it says none."""
# The last four are µ read in another encoding than it was written in.
_MICRO = ("u", "µ", "μ", "æ", "Âµ", "Î¼", "�")
_SMALL = {"m": 1e-3, "n": 1e-9, "p": 1e-12} | dict.fromkeys(_MICRO, 1e-6)
_WORDS = {"milli": 1e-3, "mili": 1e-3, "micro": 1e-6, "mikro": 1e-6, "nano": 1e-9, "": 1.0}
_SECONDS = ("second", "seconds", "sekunde", "sekunden", "seconde", "secondes", "segundo",
            "segundos", "secondo", "secondi")  # fmt: skip
TIME = (
    {f"{p}{s}": f for p, f in _SMALL.items() for s in ("s", "sec", "secs")}
    | {f"{p}{s}": f for p, f in _WORDS.items() for s in _SECONDS}
    | dict.fromkeys(("s", "sec", "secs", "sek"), 1.0)
    | dict.fromkeys(("fs", "femtosecond", "femtoseconds"), 1e-15)
    | {"с": 1.0, "сек": 1.0, "мс": 1e-3, "мкс": 1e-6, "нс": 1e-9}
    | {"min": 60.0, "minute": 60.0, "minutes": 60.0, "h": 3600.0, "hour": 3600.0, "hours": 3600.0}
)
LENGTH = (
    {f"{p}m": f for p, f in _SMALL.items()}
    | {f"{p}met{e}{s}": f for p, f in _WORDS.items() for e in ("er", "re") for s in ("", "s")}
    | {"m": 1.0, "cm": 1e-2, "centimeter": 1e-2, "centimeters": 1e-2, "centimetre": 1e-2}
    | {"centimetres": 1e-2, "dm": 0.1, "km": 1e3, "kilometer": 1e3, "kilometre": 1e3}
    | {"micron": 1e-6, "microns": 1e-6, "in": 0.0254, "inch": 0.0254, "inches": 0.0254}
    | {"м": 1.0, "см": 1e-2, "мм": 1e-3, "мкм": 1e-6}
    # Simulations of atoms; Å is written by two characters that look alike.
    | dict.fromkeys(("Å", "\u212b", "å", "angstrom", "angstroms", "ångström", "ångströms"), 1e-10)
    | {"ft": 0.3048, "feet": 0.3048, "foot": 0.3048}
)
# Said by a unit row or a bracket, these tell that a column is neither times nor positions.
_OTHER_WORDS = """v mv kv uv µv μv volt volts millivolt a ma amp ampere w pa kpa mpa bar hz khz mhz
    n kn g gal m/s mm/s um/s µm/s μm/s m/s2 m/s^2 m/s² mm/s^2 rad deg counts count lsb adc db °c c k
    % a.u. au arb arb. strain 1 - –"""
_OTHER = frozenset(_OTHER_WORDS.split())
FREQUENCY = {
    f"{p}{s}": f
    for p, f in {"": 1.0, "m": 1e-3, "k": 1e3, "K": 1e3, "M": 1e6, "G": 1e9}.items()
    for s in ("Hz", "S/s", "Sa/s", "SPS", "fps")
} | {"hz": 1.0, "hertz": 1.0, "khz": 1e3, "mhz": 1e6, "ghz": 1e9, "1/s": 1.0, "s-1": 1.0,
     "sps": 1.0, "samples/s": 1.0, "samples per second": 1.0, "1/ms": 1e3, "1/us": 1e6}  # fmt: skip
_TABLES = {"time": TIME, "position": LENGTH, "frequency": FREQUENCY}
NAMES = {
    "time": ("s", "ms", "us", "ns", "min", "h"),
    "position": ("m", "cm", "mm", "um", "km", "in", "ft"),
}
# 10^-6 s, ×10⁻⁶ s, 1e-6 s
_POWER = re.compile(
    r"[x×*·]?\s*(?:10\s*(?:\^\s*\{?|(?=[-+]))|1[eE])([-+]?\d+)\}?\s*[·*]?\s*([^\W\d]+)"
)
_RAISED = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹−", "-0123456789-")
NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"


def factor(unit: str | None, kind: str) -> float | None:
    """What a unit is in s, m or Hz; None where it is none of that kind.

    Args:
        unit: as it is spelt: "us", "µs", "Microseconds", "mm", "kHz".
        kind: "time", "position" or "frequency".
    """
    if not unit:
        return None
    text = unit.strip().strip("()[]{}<>").strip()
    table = _TABLES[kind]
    if power := _POWER.fullmatch(text.translate(_RAISED)):
        of = factor(power.group(2), kind)
        return of and float(f"{of:g}e{power.group(1)}") if of in (None, 1.0) else None
    # Ms and MS are no milliseconds to a physicist, but no instrument means megaseconds.
    return table.get(text, table.get(text.lower()))


def size_of_values(heading: str, unit: str) -> tuple[str, float] | None:
    """Of what a column's values are and in how much of it: ("V", 1e-3) of "CH1 (mV)", "CH1 / mV";
    or None."""
    for text in (unit, *re.findall(r"[\(\[/]\s*([^()\[\]]+?)\s*(?:[\)\]]|$)", heading)):
        if found := re.fullmatch(r"([munpkMµμ]?)(V|A|Pa|N|g|m/s|m/s\^?2|m/s²)", text.strip()):
            return found.group(2), (_SMALL | {"k": 1e3, "M": 1e6, "": 1.0})[found.group(1)]
    return None


def is_unit(text: str) -> bool:
    """Whether a cell of a heading is a unit and nothing else."""
    bare = text.strip().strip("()[]{}").strip()
    known = bare.lower() in _OTHER or factor(bare, "time") or factor(bare, "position")
    return bool(bare) and bool(known)


_BRACKETED = r"[\(\[\{<]\s*((?:[x×*·]?\s*1[0eE][^a-zA-Z]*)?(?:[^\d\W]|�)+)\s*[\)\]\}>]"
_MICRO_OF_TEX = re.compile(r"\$|\\,|(\\mu)\s*")


def unknown_unit_in(heading: str) -> str | None:
    """What stands in a heading's brackets, where that is no unit that is known."""
    found = re.search(_BRACKETED, heading)
    return found.group(1) if found and not is_unit(found.group(1)) else None


def unit_in(heading: str, kind: str) -> str | None:
    """The unit that a heading or a name carries: "Time (us)", "t_ms", "Zeit/µs", "time, us"."""
    heading = _MICRO_OF_TEX.sub(lambda found: "u" if found.group(1) else "", heading)
    for pattern in (
        _BRACKETED,
        r"(?:[/_,:]|\bin\b)\s*((?:[^\d\W_]|�)+)\.?\s*$",
        r"\s((?:[^\d\W_]|�)+)\.?\s*$",
        r"[a-z]([UMN]s|Sec|[CM]m)$",
    ):
        for found in re.findall(pattern, heading):
            if factor(found, kind) is not None:
                return str(found)
    return None


def without_unit(heading: str) -> str:
    """A heading without its unit: "CH1" of "CH1 (V)", "CH1 / V", "CH1, V", "CH1_V"."""
    text = heading.strip()
    if found := re.fullmatch(r"(.+?)\s*[(\[{<].*", text):
        return found.group(1)
    found = re.fullmatch(r"(.+?)\s*([/,_])\s*([^\W\d_][^\s_]*)", text)
    if not found or not is_unit(found.group(3)):
        return text
    # "_m" and "_s" end many a name that is no unit's.
    unit = found.group(3)
    own = size_of_values("", unit) or factor(unit, "frequency")
    return text if found.group(2) == "_" and not own else found[1]


def named_as(text: str, names: Sequence[str]) -> list[int]:
    """Places of the names that a text means: as they are written, else whatever the case, else
    without their units; several where that is not unique, none where there is no such."""
    asked = text.strip().strip('"')
    own = [name.strip().strip('"') for name in names]
    low = asked.casefold()
    ways = (
        [name == asked for name in own],
        [name.casefold() == low for name in own],
        [without_unit(name).casefold() == low for name in own],
    )
    return next(([i for i, yes in enumerate(way) if yes] for way in ways if any(way)), [])


_UNIT_OF_TIME = re.compile(
    r"(?:\b(?:time|t|x|horizontal|horiz)[\s_-]*(?:axis)?[\s_-]*units?|\btimes?\s+in|\bunits?\s*[:=])"
    r"[\W_]*([^\W\d_]+)",
    re.IGNORECASE,
)


def unit_of_time_said(text: str) -> str | None:
    """The unit of all times that a line says: "Time unit,ms", "X Units: us", "time in ms"."""
    found = (match for match in _UNIT_OF_TIME.findall(text) if factor(match, "time"))
    return next(found, None)


def measured_by(name: str) -> str | None:
    """Of what an entry is the unit: t of "t_unit", time of "timeUnits"; None where of nothing."""
    found = re.fullmatch(r"(.*[^_\W])[_.]?(?:units?|uom)", name, re.IGNORECASE)
    return found.group(1) if found else None


_PLACE = r"(?:x|r|z|y|pos|position|offset|offs|dist|distance|place|ort|abstand|entfernung)"
_UNIT = r"(µm|μm|um|mm|cm|dm|km|nm|m|meters?|metres?|inch|in|ft)"
_RECEIVER = "(?:ch|chan|channel|receiver|sensor|geophone|accelerometer|mic|microphone|gauge|probe)"
_SAID = (
    # x=0.02, x = 20 mm, x_mm=20, x (mm) = 20, position: 0.02 m
    re.compile(
        rf"(?:^|[^A-Za-zµμ]){_PLACE}(?:[\s_]*[\(\[]?{_UNIT}[\)\]]?)?\s*[=:]\s*({NUMBER})\s*"
        rf"[\(\[]?{_UNIT}?[\)\]]?(?![A-Za-z/])",
        re.IGNORECASE,
    ),
    # x_0.02m, offset 20 mm, ch1 @ 0.02 m, ch1 at 20mm
    re.compile(
        rf"(?:^|[^A-Za-z])(?:{_PLACE}|@|at|bei)()[\s_]*({NUMBER})\s*{_UNIT}(?![A-Za-z/])",
        re.IGNORECASE,
    ),
    # ch1 (20 mm), of what receives alone: laser (633 nm), range (2 mm), ch1 (1 M) say none
    re.compile(rf"^(?i:{_RECEIVER})[\s_#-]*\w{{0,3}}\s*[(\[]()\s*({NUMBER})\s*{_UNIT}\s*[)\]]\s*$"),
    # u(20 mm), v(20 mm)/(mm/s): a quantity as a function of place
    re.compile(rf"^[uvwapyUVWAP][xyz]?\(()\s*({NUMBER})\s*{_UNIT}\s*\)\s*(?:/.*)?$"),
    # 20 mm and nothing else
    re.compile(rf"^()\s*({NUMBER})\s*{_UNIT}\s*$", re.IGNORECASE),
)


def position_in(heading: str) -> Said | None:
    """The position that a heading says, and its unit; None where it says none.

    A number is a position only where a name of one stands before it (x = 0.02), or a unit of
    length behind it (20 mm, ch1 @ 0.02 m, ch1 (20 mm)): "Channel 1 (V)", "1" and "S-1" say none.
    """
    text = heading.strip().strip('"').replace("−", "-")
    for pattern in _SAID:
        found = pattern.search(text)
        if found:
            before, number, after = found.groups()
            return float(number), after or before or None
    return None


def alike(said: Sequence[Said]) -> tuple[list[float], str | None, bool]:
    """Positions that several headings say, as numbers of one unit.

    Returns:
        (numbers, their unit, None where none says one, whether units differ, which are m then).
    """
    units = {unit for _, unit in said}
    if len(units) == 1:
        return [number for number, _ in said], units.pop(), False
    scales = [factor(unit, "position") or 1.0 for _, unit in said]
    # Written as decimals: 20 mm is 0.02 m to the last digit.
    numbers = [float(f"{n * f:.15g}") for (n, _), f in zip(said, scales, strict=True)]
    return numbers, "m", True


def is_time(heading: str) -> bool:
    """Whether a heading names times."""
    text = heading.strip().strip('"').lower()
    return bool(
        re.match(
            r"(t|time|times|zeit|temps|tiempo|tempo|tijd|время|seconds?|secs?|elapsed|timestamps?|"
            r"datetime|x-axis|x_value|x value|x-achse)(?![^\W\d_]|[- ]?\d+\s*\()",
            text,
        )
        or text.strip("()[] ") == "s"
    )


def is_index(heading: str) -> bool:
    """Whether a heading names the number of a row."""
    return bool(re.match(r"(sample|index|point|row|nr|no|num|number|n|#|id|frame|sequence)s?"
                         r"( ?(no|nr|number|#))?\b[.# ]*$",
                         heading.strip().strip('"').lower()))  # fmt: skip
