"""Tables of text as instruments and spreadsheets write them: where the numbers begin, how parted.

Metadata, comments, a row of headings, a row of units, then numbers (``cells.py``).
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.content import RecordError
from wavesim.records.formats.cells import numbers_of, uneven
from wavesim.records.formats.dialect import (
    CLOCK,
    decoded,
    dialect,
    is_number,
    is_row,
    readable,
    splitter,
)
from wavesim.records.units import is_index, is_time, is_unit, position_in

_COMMENTS = ("#", "%", "!", "//", '"#', "'")
_REMARK = re.compile(r"comment|remark|note|bemerkung", re.IGNORECASE)
_UNITS = re.compile(r"(units?|einheit(en)?|unités?)\W*", re.IGNORECASE)
_BRACKETED = re.compile(r"\(.*\)|\[.*\]")
_SETS = re.compile(r"\w+ *= *[-+.\d]")
# Metadata beside the first rows go on no further than so many.
_BESIDE = 40
_LONGEST_HEAD = 4
# Rows of words below the numbers are so many at most.
_BELOW = 20


@dataclass
class Table:
    """A table of numbers.

    Attributes:
        headings: of its columns, "" where there is none.
        units: of its columns, "" where none is said.
        rows: lines of the file that headings and units stand in, 0 where there are none.
        data: shape (n, m), NaN where a cell is blank or marked.
        columns: their numbers in the file, from 1.
        lines: of the file, that each row stands in.
        overload: number of cells of each column marked as out of range.
        dated: columns of dates or times of day, which are in s.
        notes: what was left out.
        above: other rows above the numbers, as cells.
        metadata: all rows and comments above and beside the numbers, as cells.
    """

    headings: list[str]
    units: list[str]
    rows: tuple[int, int]
    data: NDArray[Any]
    columns: list[int]
    lines: NDArray[Any]
    overload: list[int]
    dated: list[int]
    notes: list[str]
    above: list[list[str]]
    metadata: list[list[str]]


def read_table(path: Path) -> Table:
    """The table of a text file.

    Raises:
        RecordError: it holds none, or a cell that is no number; row and column are named.
    """
    notes: list[str] = []
    lines = re.split(r"\r\n|\r|\n", decoded(path.read_bytes()))
    numbered = [
        (number, line) for number, line in enumerate(lines, 1)
        if line.strip(' \t,;|"') and not line.lstrip().startswith(_COMMENTS)
    ]  # fmt: skip
    comments = [(n, line) for n, line in enumerate(lines, 1)
                if line.lstrip().startswith(_COMMENTS)]  # fmt: skip
    if len(numbered) < 2:
        raise RecordError("holds no table: a heading and a row for each time are needed")
    separator, decimal, width = dialect([line for _, line in numbered])
    cells = splitter(separator)
    numbered, width, beside, in_file = _without_metadata(numbered, cells, separator, width)
    first = _first_row(numbered, cells, decimal, width)
    if first is None and not any(is_number(c, decimal) for c in cells(numbered[0][1])):
        # Rows that no message but one of a cell's would help.
        first, width = 1, len(cells(numbered[0][1]))
    if first is None:
        raise RecordError(
            "holds no table: no rows of numbers, parted by comma, semicolon, tab or space, were "
            "found; a row for each time is needed"
        )
    heads = {line.strip() for _, line in numbered[:first] if not is_row(cells(line), decimal)}
    body = [(n, line) for n, line in numbered[first:] if line.strip() not in heads]
    if again := len(numbered) - first - len(body):
        notes.append(f"rows of headings that stand again: {again} left out")
    above = [(n, cells(line)) for n, line in numbered[:first]]
    before = [(n, cells(_uncommented(line))) for n, line in comments if n < body[0][0]]
    if not any(len(row) == width for _, row in above[-1:]):
        above = sorted(above + before)
    _check_heading(above, width, body[0][0], decimal, separator)
    headings, units, rows = _headings(above[-_LONGEST_HEAD:], width)
    if decimal == ",":
        headings = [re.sub(r"(?<=\d),(?=\d)", ".", heading) for heading in headings]
    # Rows of words below the numbers, as of their largest and mean.
    least = max(2, len(body) - _BELOW)
    last = len(body)
    while last > least and not readable(cells(body[last - 1][1])[0], decimal):
        last -= 1
    if len(body) - last > 1:
        notes.append(f"{len(body) - last} rows below the numbers: left out")
        body = body[:last]
    # The last row of a file cut short.
    if len(body) > 2 and not _whole(body[-1][1], cells, decimal, width):
        body = body[:-1]
        notes.append("the last row is not whole: left out")
    data, overload, dated = numbers_of(body, cells, separator, decimal, width, headings)
    units = [unit or ("s" if c in dated else "") for c, unit in enumerate(units)]
    kept = [c for c in range(width) if np.isfinite(data[:, c]).any() or headings[c].strip()]
    if len(kept) > 1 and kept[0] == 0 and not any(cells(line)[0] for _, line in body):
        kept = kept[1:]  # rows that begin with a separator
    spare = [c for c in kept if not np.isfinite(data[:, c]).any()]
    # A column that is empty throughout, of times or named as a remark or as what it sets, is none.
    kept = [
        c for c in kept if c not in spare or not (is_time(headings[c]) or _is_aside(headings[c]))
    ]
    return Table(
        [headings[c] for c in kept],
        [units[c] for c in kept],
        rows,
        data[:, kept],
        [in_file[c] for c in kept],
        np.array([n for n, _ in body]),
        [overload[c] for c in kept],
        [n for n, c in enumerate(kept) if c in dated],
        notes,
        [row for _, row in above],
        [*beside, *(cells(line) for _, line in numbered[:first]), *(row for _, row in before)],
    )


def _without_metadata(
    numbered: list[tuple[int, str]], cells: Any, separator: str | None, width: int
) -> tuple[list[tuple[int, str]], int, list[list[str]], list[int]]:
    """Rows without the columns that some oscilloscopes fill with metadata beside the first rows.

    Returns:
        (rows, their width, the metadata, numbers in the file of the columns that stay).
    """
    whole = list(range(1, width + 1))
    later = numbered[_BESIDE :: max(1, len(numbered) // 300)]
    if separator is None or len(later) < _BESIDE:
        return numbered, width, [], whole
    rows = [cells(line) for _, line in later]
    blank = [c for c in range(width) if not any(c < len(row) and row[c] for row in rows)]
    early = [cells(line) for _, line in numbered[:_BESIDE]]
    if any(len(row) != width for row in early):
        return numbered, width, [], whole
    filled = [c for c in blank if sum(bool(row[c]) for row in early) > 1]
    if not filled:
        return numbered, width, [], whole
    stay = [c for c in range(width) if c not in blank]
    kept = []
    for number, line in numbered:
        row = cells(line)
        if len(row) == width:
            line = separator.join(row[c] for c in stay)
        kept.append((number, line))
    beside = [[row[c] for c in blank if row[c]] for row in early]
    return kept, len(stay), beside, [c + 1 for c in stay]


def _uncommented(line: str) -> str:
    return line.strip().lstrip('#%!/"').strip()


def _first_row(numbered: list[tuple[int, str]], cells: Any, decimal: str, width: int) -> int | None:
    """Where the numbers begin."""
    for place, (_, line) in enumerate(numbered):
        row = cells(line)
        if len(row) != width or not is_row(row, decimal):
            continue
        after = [cells(other) for _, other in numbered[place + 1 : place + 4]]
        if not after or sum(len(r) == width and is_row(r, decimal) for r in after) * 2 >= len(
            after
        ):
            return place
    return None


def _whole(line: str, cells: Any, decimal: str, width: int) -> bool:
    row = cells(line)
    return len(row) == width and all(readable(c, decimal) for c in row)


def _headings(
    above: list[tuple[int, list[str]]], width: int
) -> tuple[list[str], list[str], tuple[int, int]]:
    """Headings and units from the rows next above the numbers, and these rows' lines."""
    blank = [""] * width

    def fitted(row: list[str]) -> list[str] | None:
        row = _trimmed(row, width)
        if len(row) == width + 1 and row[0].endswith(":"):
            row = row[1:]  # "columns: time[us] sent[V]"
        if len(row) == width - 1 and width > 1 and not any(is_number(c, ".") for c in row):
            row = [*row, ""]  # rows that end in a separator
        return list(row) if len(row) == width else None

    rows: list[tuple[int, list[str]]] = []
    for number, row in reversed(above):
        if (fit := fitted(row)) is None:
            break
        rows.append((number, fit))
    line, units = next((one for one in rows if _all_units(one[1])), (0, blank))
    rows = [one for one in rows if one[0] != line]
    # A row of remarks may stand between the heading and the numbers.
    named = (one for one in rows if all(one[1]) and len(one[1]) > 2
             and any(is_time(c) or is_index(c) for c in one[1][:2]))  # fmt: skip
    at, heading = next(named, rows[0] if rows else (0, blank))
    return heading, [u.strip("()[]{} ") for u in units], (at, line)


def _check_heading(
    above: list[tuple[int, list[str]]],
    width: int,
    line: int,
    decimal: str,
    separator: str | None,
) -> None:
    """Refuse rows that have fewer cells than the heading above them names, or one that has more."""
    if len(above) > 1 and len(above[-2][1]) == width and is_time(above[-2][1][0]):
        number, row = above[-1]
        if len(row) != width and is_row(row, decimal):
            raise RecordError(uneven(number, len(row), width, separator))
    if not above or not is_time(above[-1][1][0]):
        return
    row = above[-1][1]
    if len(row) > 1 and all(CLOCK.fullmatch(c.strip(' "')) for c in row[1:] if c.strip()):
        return  # when each channel was recorded
    row = _trimmed(row, width)
    if len(row) not in (width, width - 1):
        raise RecordError(
            f"row {line} has {width} cells; the heading has {len(row)}: give each column a "
            "heading, and each row a cell for each"
        )


def _trimmed(row: list[str], width: int) -> list[str]:
    """A row without what stands behind its last column and is of none."""
    while len(row) > width and (not row[-1].strip() or _is_aside(row[-1])):
        row = row[:-1]
    return row


def _is_aside(cell: str) -> bool:
    """Whether a cell is of no column: a remark, or what it sets, as "t0 = -1E-4"."""
    return bool(_REMARK.match(cell)) or (bool(_SETS.match(cell)) and position_in(cell) is None)


def _all_units(row: list[str]) -> bool:
    said = [c for c in row if c.strip() and not _UNITS.fullmatch(c.strip())]
    known = all(is_unit(c) or _BRACKETED.fullmatch(c.strip()) for c in said)
    return bool(said) and known and len(said) * 2 >= len(row)
