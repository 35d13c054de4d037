"""The unit of each number of a case file, and what a text given in its place was meant to be."""

from __future__ import annotations

import re

from wavesim.material.parameter import PARAMETERS

# By key; where the tables give one key two meanings the unit is the same.
UNITS = (
    dict.fromkeys(
        ("length", "spacing", "absorber", "from", "to", "thickness", "position", "width"), "m"
    )
    | dict.fromkeys(("duration", "step", "delay", "start", "times", "stiffness_damping"), "s")
    | dict.fromkeys(("peak_frequency", "frequency", "low", "high", "quality_band"), "Hz")
    | dict.fromkeys(("k_min", "k_max"), "rad/m")
    | dict.fromkeys(("at_most", "at_least"), "dB")
    | {"mass_damping": "1/s"}
)  # fmt: skip
_FACTORS = {
    "m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "μm": 1e-6, "nm": 1e-9},
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "ns": 1e-9},
    "Hz": {"hz": 1.0, "khz": 1e3, "mhz": 1e6, "ghz": 1e9},
}
_TEXT = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*)")
_LEAST_DIGITS = 12


def unit_of(key: str) -> str:
    """The unit of a key's number, "" where it has none."""
    known = PARAMETERS.get(key)
    return known.unit if known else UNITS.get(key, "")


def numbered(key: str, message: str, value: str) -> str:
    """A message that a key must be a number, with unit, form, and the number if it is clear.

    Args:
        key: of the case file.
        message: "must be a number" within it.
        value: the text that was given.

    Returns:
        Such as "must be a number in Hz, without quotes or unit: 50000.0".
    """
    unit = unit_of(key)
    if unit:
        message = message.replace("must be a number", f"must be a number in {unit}", 1)
    meant = meant_by(unit, value)
    return f"{message}, without quotes or unit{f': {meant}' if meant else ''}"


def meant_by(unit: str | None, value: str) -> str | None:
    """The number in a unit that a text such as "50 kHz" gives; None where it can't be told."""
    match = _TEXT.fullmatch(value.strip())
    if match is None:
        return None
    number, given = float(match[1]), match[2].strip()
    known = _FACTORS.get(unit or "", {})
    factor = known.get(given.lower() if unit == "Hz" else given)
    if given in ("", unit):
        factor = 1.0
    if factor is None:
        return None
    if factor == 1.0:
        return repr(number)
    return repr(float(f"{number * factor:.{_LEAST_DIGITS}g}"))
