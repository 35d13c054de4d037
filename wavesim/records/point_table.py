"""Tables of points (k, ω) that this program or another wrote, as columns."""

from __future__ import annotations

import re
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.content import RecordError
from wavesim.records.formats.dialect import is_number
from wavesim.records.units import factor, named_as, without_unit

Float = NDArray[Any]

# Names of columns, in lower case, and what a number in them is in rad/m, rad/s.
_NAMES: dict[str, dict[str, float]] = {
    "k": {"k": 1, "k_rad_per_m": 1, "wavenumber": 1, "k_real_rad_per_m": 1, "k_real": 1},
    "k_imag": {"k_imag": 1, "k_imag_rad_per_m": 1, "alpha": 1, "attenuation": 1},
    "omega": {
        "omega": 1, "omega_rad_per_s": 1, "w": 1, "ω": 1,
        "f": 2 * np.pi, "freq": 2 * np.pi, "frequency": 2 * np.pi,
    },
    "sigma": {"sigma": 1, "sigma_rad_per_s": 1},
    "error": {
        "error": 1, "omega_error": 1, "omega_error_rad_per_s": 1, "k_error_rad_per_m": 1,
        "f_error": 2 * np.pi, "frequency_error": 2 * np.pi, "err": 1, "std": 1, "se": 1,
        "uncertainty": 1, "standard error": 1, "standard_error": 1,
    },
    "valid": {"valid": 1},
    "branch": {"branch": 1},
}  # fmt: skip
# Errors whose heading does not say of what.
_OF_WHICH = ("error", "err", "std", "se", "uncertainty", "standard error", "standard_error")
_SIZES = {
    "rad/m": 1.0, "rad/cm": 100.0, "rad/mm": 1e3, "np/m": 1.0, "rad/s": 1.0, "rad/ms": 1e3,
    "krad/s": 1e3, "rad/us": 1e6, "rad/µs": 1e6, "–": 1.0, "-": 1.0,
    **{f"{turn}/{long}": 2 * np.pi * many for turn in ("cycles", "cycle", "cyc")
       for long, many in (("m", 1.0), ("cm", 100.0), ("mm", 1e3))},
}  # fmt: skip
# What may be radians or cycles: as usual for the column, and for k not known.
_BARE = {"1/m": 1.0, "1/cm": 100.0, "1/mm": 1e3, "1/s": 1.0, "1/ms": 1e3}
# In which the case tells.
_CASED = {"Mrad/s": 1e6, "mrad/s": 1e-3}
# No wave has more of anything, and sums of squares are numbers.
_LARGEST = 1e100
_DECIMAL_COMMA = re.compile(r"\d,\d")
_TRUE, _FALSE = {"true", "1", "1.0", "yes"}, {"false", "0", "0.0", "no"}


# Of what no fit can do without.
ERRORS = ("error", "error, one standard error")


def read_points(path: str | Path, *needed: tuple[str, str]) -> dict[str, Any]:
    """Columns of a table of points.

    Args:
        path: a text file, parted by semicolons, tabs, commas or spaces, with decimal commas where
            these do not part it; lines after # are left out. Headed as ``--out`` of dispersion and
            attenuation writes it, or k, omega (or frequency, in Hz), error in the same unit, and
            for attenuation k_imag and sigma; a row of units may follow. Without a heading k, omega
            and perhaps error.
        needed: what must be there beside k and omega, each with an example of its heading.

    Returns:
        k (complex for attenuation), omega, and where they are there error, valid and branch.

    Raises:
        RecordError: it can't be read so; one line that names file, column and what is expected.
    """
    import pandas as pd  # slow to import, and only a table needs it

    path = Path(path)
    if not path.is_file():
        raise RecordError(f"{path}: no such file")
    try:
        text = path.read_text(encoding="utf-8-sig")
        lines = (line for line in text.splitlines() if line.strip() and line.strip()[0] != "#")
        first, *more = [*islice(lines, 3), ""]
        headed = any(c.isalpha() for c in first.replace("e", "").replace("E", ""))
        separator = next((c for c in ";\t," if c in first), r"\s+")
        decimal = (
            "," if separator != "," and _DECIMAL_COMMA.search("".join([first, *more])) else "."
        )
        table = pd.read_csv(
            path, sep=separator, decimal=decimal, engine="python", comment="#",
            header=0 if headed else None, encoding="utf-8-sig", skipinitialspace=True,
        )  # fmt: skip
    except (OSError, ValueError) as error:  # UnicodeDecodeError and pandas' own are ValueErrors
        line = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise RecordError(f"{path}: can't be read as a table of points: {line}") from None
    if not headed:
        usual = ["k", "omega", "error"][: table.shape[1]]
        table = table.iloc[:, : len(usual)].set_axis(usual, axis=1)
    own = [str(name) for name in table.columns]
    if headed and len(table) and all(isinstance(cell, str) for cell in table.iloc[0]):
        units = [cell.strip() for cell in table.iloc[0]]
        if not any(is_number(unit, decimal) for unit in units):
            own = [f"{name} ({unit})" for name, unit in zip(own, units, strict=True)]
            table = table.iloc[1:]
            if decimal == ",":  # cells below words stayed as they are
                table = table.map(lambda cell: str(cell).replace(",", "."))
    found: dict[str, Any] = {}
    sizes: dict[str, float] = {}
    for what, names in _NAMES.items():
        for name, size in names.items():
            at = named_as(name, own)
            if len(at) > 1:
                raise RecordError(
                    f"{path}: {len(at)} columns are {what}, {', '.join(own[i] for i in at)}: "
                    "keep one"
                )
            if at:
                column, heading = table.iloc[:, at[0]], own[at[0]]
                if what == "error" and name in _OF_WHICH and "k_imag" not in found:
                    size = sizes.get("omega", size)  # in the unit of what it is of
                sizes[what] = _size(path, heading, size)
                found[what] = _flags(path, column) if what == "valid" else (
                    _numbers(path, heading, column) * sizes[what]
                )  # fmt: skip
                break
    for what, example in (("k", "k (rad/m)"), ("omega", "omega (rad/s), frequency (Hz)"), *needed):
        if what not in found:
            raise RecordError(
                f"{path}: has no column of {what} (such as {example}); its columns are "
                f"{', '.join(own)}"
            )
    if not len(table):
        raise RecordError(f"{path}: holds no points")
    if "k_imag" in found:
        found["k"] = found["k"] + 1j * found.pop("k_imag")
        found["omega"] = found["omega"] + 1j * found.pop("sigma", 0.0)
    found.pop("sigma", None)
    return found


def _size(path: Path, heading: str, usual: float) -> float:
    """What a number in a column is in SI, by the unit in its heading; as usual without one."""
    unit = heading.strip().removeprefix(without_unit(heading)).strip(" ()[]{}<>/,_")
    if not unit:
        return usual
    if unit in _BARE:
        if without_unit(heading).strip(" ([{</,_").casefold() in _NAMES["k"]:
            raise RecordError(
                f"{path}: column {heading}: radians or cycles per length, 2π apart: write rad/m "
                "or cycles/m"
            )
        return usual * _BARE[unit]
    if (size := _CASED.get(unit, _SIZES.get(unit.casefold()))) is not None:
        return size
    if (hertz := factor(unit, "frequency")) is not None:
        return 2 * np.pi * hertz
    raise RecordError(f"{path}: column {heading}: {unit} is no unit of it: give rad/m, rad/s or Hz")


def _numbers(path: Path, name: Any, column: Any) -> Float:
    import pandas as pd

    numbers = pd.to_numeric(column, errors="coerce")
    bad = numbers.isna() & column.notna() & (column.astype(str).str.strip().str.lower() != "nan")
    bad |= numbers.abs() > _LARGEST
    if bad.any():
        at = int(np.flatnonzero(bad)[0])
        raise RecordError(
            f"{path}: column {name}, row {at + 1}: {str(column.iloc[at])[:40]!r} is no number"
            + (f" up to {_LARGEST:g}" if abs(numbers.iloc[at]) > _LARGEST else "")
        )
    return np.asarray(numbers, float)


def _flags(path: Path, column: Any) -> NDArray[np.bool_]:
    words = column.astype(str).str.strip().str.lower()
    odd = ~words.isin(_TRUE | _FALSE)
    if odd.any():
        at = int(np.flatnonzero(odd)[0])
        raise RecordError(
            f"{path}: column valid, row {at + 1}: {str(column.iloc[at])[:40]!r}; must be True or "
            "False"
        )
    return np.asarray(words.isin(_TRUE), bool)


def is_points(path: Path) -> bool:
    """Whether a file is a table of points: its first line names k and ω or a frequency."""
    if not path.is_file() or path.suffix.lower() not in (".csv", ".txt"):
        return False
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        first = next((line for line in file if line.strip() and line.strip()[0] != "#"), "")
        names = [name.strip() for name in re.split("[,;\t]", first[:4096])]
    return all(any(named_as(one, names) for one in _NAMES[what]) for what in ("k", "omega"))
