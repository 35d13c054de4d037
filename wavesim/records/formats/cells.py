"""The cells below the headings of a table of text, as numbers, which pandas reads.

Dates and times of day are seconds from the first. A cell that is no number, or a row of another
width, is named.
"""

from __future__ import annotations

import io
import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.content import RecordError, check_size
from wavesim.records.formats.dialect import CLOCK, MARKS, NUMBERS, OVERLOAD

# So many numbers look like thousands that are parted, at least.
_PARTED = 20
_DAY = 86400.0  # s


def numbers_of(
    body: list[tuple[int, str]],
    cells: Any,
    separator: str | None,
    decimal: str,
    width: int,
    headings: list[str],
) -> tuple[NDArray[Any], list[int], list[int]]:
    """The body as numbers, by pandas; a cell that is none is named by row and column.

    Returns:
        (numbers, how many cells of each column are marked as out of range, columns of dates).
    """
    import pandas

    check_size((len(body), width), "table")
    _check_widths(body, cells, separator, width)
    text = "\n".join(line.strip() if separator is None else line for _, line in body)
    text = text.replace("−", "-")
    table = pandas.read_csv(
        io.StringIO(text),
        sep=r"\s+" if separator is None else separator,
        decimal=decimal,
        header=None,
        names=list(range(width)),
        index_col=False,
        na_values=sorted({form for m in MARKS for form in (m, m.upper(), m.capitalize())}),
        keep_default_na=False,
        skipinitialspace=True,
        engine="c",
    )
    data = np.full((len(body), width), np.nan)
    overload, dated = [0] * width, []
    for c in range(width):
        column = table[c]
        if column.dtype.kind in "fiu":
            data[:, c] = column
            _check_thousands(data[:, c], c, body, cells, headings)
        elif column.dtype.kind == "b" or not len(column):
            raise RecordError(f"{_column(c, headings)}: holds no numbers")
        else:
            text_of = ["" if cell != cell else str(cell) for cell in column.tolist()]
            data[:, c], dates = _odd_column(text_of, c, body, decimal, headings)
            dated += [c] * dates
        infinite = np.isinf(data[:, c])
        data[infinite, c] = np.nan
    gone = np.argwhere(~np.isfinite(data))
    for r, c in gone[:100_000]:
        overload[c] += cells(body[r][1])[c].strip().lower() in OVERLOAD
    return data, overload, dated


def _check_thousands(
    column: NDArray[Any], c: int, body: list[tuple[int, str]], cells: Any, headings: list[str]
) -> None:
    """Refuse whole numbers that have a mark from a thousand on, as "1.234" beside "543"."""
    size = np.abs(column)
    whole = size == np.round(size)
    parted = np.flatnonzero(~whole & np.isfinite(size))
    beside = np.flatnonzero(whole & (size >= 100))
    if len(parted) < _PARTED or not len(beside) or size[parted].min() < 1 or np.nanmax(size) >= 1e3:
        return
    texts = [cells(body[r][1])[c] for r in (*parted, beside[0])]
    if all(re.fullmatch(r"[-+−]?\d{1,3}[.,]\d{3}", text) for text in texts[:-1]) and re.fullmatch(
        r"[-+−]?\d{3}", texts[-1]
    ):
        raise RecordError(
            f"{_column(c, headings)}: holds {texts[0]!r} beside {texts[-1]!r}, as of thousands "
            "that are parted: write numbers without"
        )


def _odd_column(
    column: list[str], c: int, body: list[tuple[int, str]], decimal: str, headings: list[str]
) -> tuple[NDArray[Any], bool]:
    """A column that pandas did not take for numbers: Fortran's exponents, clocks, or wrong.

    Returns:
        (numbers, whether they were dates or times of day).
    """
    result = np.full(len(column), np.nan)
    dated = 0
    for r, cell in enumerate(column):
        text = cell.strip().strip('"').strip()
        if text.lower() in MARKS:
            continue
        if NUMBERS[decimal].fullmatch(text):
            bare = re.sub(rf"[ '’\u00a0\u202f{'.' if decimal == ',' else ','}]", "", text)
            result[r] = float(bare.replace(",", ".").replace("D", "e").replace("d", "e"))
        elif CLOCK.fullmatch(text):
            dated += 1
        else:
            remedy = "correct the cell, or leave it blank for a sample that is missing"
            if any(form.fullmatch(text) for form in NUMBERS.values()):
                remedy = (
                    "rows differ in their decimal mark, or thousands are parted; write all alike"
                )
            raise RecordError(
                f"row {body[r][0]}, {_column(c, headings)}: {text[:30]!r} is no number: {remedy}"
            )
    return (_since_first(column, c, body, headings), True) if dated else (result, False)


def _since_first(
    column: list[str], c: int, body: list[tuple[int, str]], headings: list[str]
) -> NDArray[Any]:
    """Dates or times of day as seconds from the first."""
    import pandas

    text = [cell.strip().strip('"').replace(",", ".") for cell in column]
    of_day = all(re.fullmatch(r"\d\d?:\d\d:\d\d(?:\.\d+)?", cell) for cell in text)
    try:
        if all(" day" in cell for cell in text):  # spans of time, which have a zero of their own
            return np.asarray(pandas.to_timedelta(text) / pandas.Timedelta(seconds=1), float)
        if of_day:
            elapsed = pandas.to_timedelta(text)
            seconds = np.asarray((elapsed - elapsed[0]) / pandas.Timedelta(seconds=1), float)
            # A clock that falls by more than half a day has passed midnight.
            days = np.cumsum(np.diff(seconds, prepend=0.0) < -_DAY / 2)
            return seconds + _DAY * days
        dates = pandas.to_datetime(text, format="ISO8601", utc=True)
        return np.asarray((dates - dates[0]) / pandas.Timedelta(seconds=1), float)
    except (ValueError, TypeError, OverflowError) as error:
        bad = next((r for r, cell in enumerate(text) if not CLOCK.fullmatch(cell)), 0)
        raise RecordError(
            f"row {body[bad][0]}, {_column(c, headings)}: {text[bad][:30]!r} can't be read as a "
            f"date ({str(error).splitlines()[0][:60]}): write times in seconds"
        ) from None


def _check_widths(
    body: list[tuple[int, str]], cells: Any, separator: str | None, width: int
) -> None:
    for number, line in body:
        if line.count('"') % 2:
            raise RecordError(f"row {number}: a quotation mark has no other: take it out")
        quick = len(line.split()) if separator is None else line.count(separator) + 1
        if quick == width and '"' not in line:
            continue
        found = len(cells(line))
        if found == width:
            continue
        raise RecordError(uneven(number, found, width, separator))


def uneven(number: int, found: int, width: int, separator: str | None) -> str:
    hint = ""
    if separator == ",":
        hint = "; if commas are decimal marks, part the columns by semicolons or tabs"
    return (
        f"row {number} has {found} cells; the heading has {width}: give each row one cell for "
        f"each column{hint}"
    )


def _column(c: int, headings: list[str]) -> str:
    name = headings[c].strip() if c < len(headings) else ""
    return f"column {c + 1}" + (f" ({name[:40]!r})" if name else "")
