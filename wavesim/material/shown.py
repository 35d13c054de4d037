"""What a reader is shown: numbers with units and errors; of a thing a line, a table, a picture.

A class that is :class:`Shown` says what there is to say of it; how it is drawn is known to
``wavesim.figures.notebook``, which is loaded when the first picture is asked for.
"""

from __future__ import annotations

import html
import importlib
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

# What one rad/s is in Hz and in kHz, and one neper in dB.
HERTZ = 1 / (2 * math.pi)
KHZ = 1e-3 * HERTZ
DECIBELS = 20 / math.log(10)
# An error of this part of a value has no digit beside it.
_NO_DIGIT = 1e-6
_DRAWN_BY = "wavesim.figures.notebook"


class Shown:
    """A thing with a line, a table and a picture of its own."""

    __slots__ = ()

    def told(self) -> Mapping[str, str]:
        """What there is to say of it: {what: value with its unit}, the most telling first."""
        raise NotImplementedError

    def __repr__(self) -> str:
        said = ", ".join(f"{what} {value}" for what, value in self.told().items())
        return f"<{type(self).__name__}: {said}>"

    def _repr_html_(self) -> str:
        return table({type(self).__name__: ""} | dict(self.told()))

    def plot(self, **options: Any) -> Any:
        """Its picture, a figure of matplotlib that a notebook shows by itself.

        Args:
            options: of :func:`wavesim.figures.notebook.draw` for this kind of thing.

        Returns:
            The figure; ``figure.savefig("name.pdf")`` writes it.

        Raises:
            ValueError: there is no such option.
        """
        return importlib.import_module(_DRAWN_BY).picture(self, **options)


def table(rows: Mapping[str, str]) -> str:
    """Rows of text as a table in HTML; a row without a value is a heading."""
    lines = []
    for what, value in rows.items():
        name = html.escape(what)
        if value:
            lines.append(f"<tr><td>{name}</td><td>{html.escape(value)}</td></tr>")
        else:
            lines.append(f'<tr><th colspan="2">{name}</th></tr>')
    return f"<table>{''.join(lines)}</table>"


def quantity(value: float, unit: str = "") -> str:
    """A number of four digits with its unit, for a reader: prefixed m and s, kHz and MHz."""
    for scale, prefix in _PREFIXES.get(unit, ()):
        if abs(value) >= 0.9999 * scale:
            return f"{value / scale:.4g} {prefix}{unit}"
    return f"{value:.4g} {unit}".rstrip()


_PREFIXES: dict[str, Sequence[tuple[float, str]]] = {
    "m": ((1.0, ""), (1e-3, "m"), (1e-6, "µ")),
    "s": ((1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n")),
    "Hz": ((1e6, "M"), (1e3, "k"), (1.0, "")),
}


def in_time(value: float) -> tuple[float, str]:
    """A unit in which a time is a number of few digits: its factor and name."""
    size = abs(value)
    if not math.isfinite(size) or size >= 1:
        return 1.0, "s"
    return (1e3, "ms") if size >= 2e-4 else (1e6, "µs")


def in_frequency(largest: float) -> tuple[float, str]:
    """The unit that frequencies, rad/s, are shown in: kHz, or Hz where all are slower; and what one
    rad/s is in it."""
    return (KHZ, "kHz") if largest * HERTZ >= 1e3 else (HERTZ, "Hz")


def in_wavenumber(largest: float) -> tuple[float, str]:
    """Likewise of wavenumbers, rad/m: per mm, or per m where all waves are long."""
    return (1e-3, "mm") if largest >= 1e2 else (1.0, "m")


def with_error(value: float, error: float = math.nan, unit: str = "") -> str:
    """A value to two digits of its error, "3000.8 ± 1.3 m/s", to seven digits at most; "–" where
    there is none."""
    if not math.isfinite(value):
        return "–"
    end = f" {unit}" if unit else ""
    if not (math.isfinite(error) and error > 0):
        return f"{value:.6g}{end}"
    if error < _NO_DIGIT * abs(value):
        return f"{value:.7g} ± {error:.0e}{end}"
    last = math.floor(math.log10(error)) - 1
    if abs(value) < 1e6 and (value == 0 or abs(value) >= 1e-3) and last >= -7:
        digits = max(0, -last)
        return f"{value:.{digits}f} ± {error:.{digits}f}{end}"
    first = math.floor(math.log10(abs(value))) if value else last
    return f"{value:.{max(1, first - last)}e} ± {error:.1e}{end}"


def decibels(amplitude: Any, reference: float = 1.0, least: float = 1e-15) -> Any:
    """20 log₁₀ of an amplitude over a reference, cut at the least that is told from 0: −300 dB."""
    return 20 * np.log10(np.maximum(np.abs(amplitude) / reference, least))


def plain(value: Any) -> Any:
    """Numbers of Python alone in lists and dictionaries, as JSON has them.

    What is not finite is None, and a complex number a pair [real, imaginary].
    """
    if hasattr(value, "tolist"):  # of numpy
        value = value.tolist()
    if isinstance(value, dict):
        return {key: plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    if isinstance(value, complex):
        return [plain(value.real), plain(value.imag)]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value


def printable(text: str, longest: int = 200) -> str:
    """Text as a terminal may have it: control characters and line ends escaped, cut if long."""
    text = text[: longest + 1]
    if not text.isprintable():
        text = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
    return text if len(text) <= longest else text[: longest - 1] + "…"
