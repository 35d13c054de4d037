"""Tables of text as instruments and spreadsheets write them: where the numbers begin, how parted.

Metadata, comments, a row of headings, a row of units, then numbers. The delimiter and the decimal
mark are those by which most rows of the body are numbers; pandas then reads the body.
"""

from __future__ import annotations

import csv
import io
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.content import RecordError, check_size
from wavesim.records.units import is_time, is_unit

_COMMENTS = ("#", "%", "!", "//", '"#', "'")
# Marks of a sample out of range, and of one that is not there.
_OUT_OF_RANGE = """ol +ol -ol o.l. o.l overload over overflow ovf ovfl ovrld ∞ -∞ +∞ inf -inf +inf
    infinity -infinity clip clipped sat saturated underflow under range 1.#inf -1.#inf *** ****"""
_NOT_THERE = """nan -nan na n/a #n/a null none nil - -- --- missing bad err error #value! #num!
    #div/0! 1.#qnan -1.#ind 1.#nan ?"""
OVERLOAD = frozenset(_OUT_OF_RANGE.split())
_MARKS = OVERLOAD | {"", *_NOT_THERE.split()}
_NUMBERS = {
    ".": re.compile(r"[-+−]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][-+]?\d+)?"),
    ",": re.compile(r"[-+−]?(?:\d+,?\d*|,\d+)(?:[eEdD][-+]?\d+)?"),
}
_CLOCK = re.compile(
    r"(?:\d{4}[-/]\d\d?[-/]\d\d?|\d\d?[./]\d\d?[./]\d{4})(?:[T ]\d\d?:\d\d(?::\d\d(?:[.,]\d+)?)?)?"
    r"(?:Z|[+-]\d\d:?\d\d)?|\d\d?:\d\d:\d\d(?:[.,]\d+)?"
)
# Most likely first: of those that read as many rows the first is taken.
_DIALECTS = (("\t", "."), (";", "."), (";", ","), (",", "."), ("|", "."), ("\t", ","), (None, "."),
             (None, ","), (",", ","))  # fmt: skip
# What begins with a longer mark begins with the shorter one too.
_MARKED = ((b"\xef\xbb\xbf", "utf-8-sig"), (b"\xff\xfe\0\0", "utf-32"), (b"\0\0\xfe\xff", "utf-32"),
           (b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16"))  # fmt: skip
_REMARK = re.compile(r"comment|remark|note|bemerkung", re.IGNORECASE)
_SETS = re.compile(r"\w+ *= *[-+.\d]")
# Metadata beside the first rows go on no further than so many.
_BESIDE = 40
_SAMPLE = 80
_LONGEST_HEAD = 4


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
        headed: whether there are headings.
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
    headed: bool
    notes: list[str]
    above: list[list[str]]
    metadata: list[list[str]]


def read_table(path: Path) -> Table:
    """The table of a text file.

    Raises:
        RecordError: it holds none, or a cell that is no number; row and column are named.
    """
    whole, notes = _decoded(path.read_bytes())
    lines = re.split(r"\r\n|\r|\n", whole)
    numbered = [
        (number, line) for number, line in enumerate(lines, 1)
        if line.strip() and not line.lstrip().startswith(_COMMENTS)
    ]  # fmt: skip
    comments = [(n, line) for n, line in enumerate(lines, 1)
                if line.lstrip().startswith(_COMMENTS)]  # fmt: skip
    if len(numbered) < 2:
        raise RecordError("holds no table: a heading and a row for each time are needed")
    separator, decimal, width = _dialect([line for _, line in numbered])
    cells = _splitter(separator)
    numbered, width, beside, in_file = _without_metadata(numbered, cells, separator, width)
    first = _first_row(numbered, cells, decimal, width)
    if first is None and not any(_is_number(c, decimal) for c in cells(numbered[0][1])):
        # Rows that no message but one of a cell's would help.
        first, width = 1, len(cells(numbered[0][1]))
    if first is None:
        raise RecordError(
            "holds no table: no rows of numbers, parted by comma, semicolon, tab or space, were "
            "found; a row for each time is needed"
        )
    body = numbered[first:]
    above = [(n, cells(line)) for n, line in numbered[:first]]
    before = [(n, cells(_uncommented(line))) for n, line in comments if n < body[0][0]]
    if not any(len(row) == width for _, row in above[-1:]):
        above = sorted(above + before)
    _check_heading(above, width, body[0][0], decimal, separator)
    headings, units, rows = _headings(above[-_LONGEST_HEAD:], width)
    if decimal == ",":
        headings = [re.sub(r"(?<=\d),(?=\d)", ".", heading) for heading in headings]
    # The last row of a file cut short.
    if len(body) > 2 and not _whole(body[-1][1], cells, decimal, width):
        body = body[:-1]
        notes.append("the last row is not whole: left out")
    data, overload, dated = _numbers(body, cells, separator, decimal, width, headings)
    units = [unit or ("s" if c in dated else "") for c, unit in enumerate(units)]
    kept = [c for c in range(width) if np.isfinite(data[:, c]).any() or headings[c].strip()]
    if len(kept) > 1 and not any(cells(line)[0] for _, line in body):
        kept = kept[1:]  # rows that begin with a separator
    spare = [c for c in kept if not np.isfinite(data[:, c]).any()]
    # A column that is empty throughout, of times or named as a remark or as what it sets, is none.
    kept = [
        c
        for c in kept
        if c not in spare
        or not (_REMARK.match(headings[c]) or is_time(headings[c]) or _SETS.match(headings[c]))
    ]
    return Table(
        [headings[c] for c in kept],
        [units[c] for c in kept],
        rows,
        data[:, kept],
        [in_file[c] for c in kept],
        np.array([n for n, _ in body]),
        [overload[c] for c in kept],
        any(h.strip() for h in headings),
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


def _decoded(raw: bytes) -> tuple[str, list[str]]:
    name = _wide(raw)
    if name:
        try:
            return raw.decode(name), []
        except UnicodeDecodeError as error:
            raise RecordError(f"can't be read as text: {error}") from None
    if b"\0" in raw[:100_000]:
        raise RecordError(
            "can't be read as text: it holds bytes that no text has; give it the suffix of what "
            "it is (.npz, .h5, .mat, .nc, .segy, .sac, .mseed)"
        )
    try:
        return raw.decode("utf-8"), []
    except UnicodeDecodeError:
        return raw.decode("cp1252", "replace"), []


def _wide(raw: bytes) -> str:
    """An encoding that the first bytes mark, or UTF-16 by the zeros in every other byte; or ""."""
    for mark, name in _MARKED:
        if raw.startswith(mark):
            return name
    head = raw[:1000]
    even, odd = head[::2].count(0), head[1::2].count(0)
    if len(head) > 8 and max(even, odd) > 0.4 * len(head) and min(even, odd) == 0:
        return "utf-16-le" if odd else "utf-16-be"
    return ""


def _uncommented(line: str) -> str:
    return line.strip().lstrip('#%!/"').strip()


def _splitter(separator: str | None) -> Any:
    if separator is None:
        return lambda line: line.split()

    def cells(line: str) -> list[str]:
        if '"' in line:
            try:
                return [c.strip() for c in next(csv.reader([line], delimiter=separator))]
            except (csv.Error, StopIteration):
                pass
        return [c.strip() for c in line.rstrip("\r\n").split(separator)]

    return cells


def _readable(cell: str, decimal: str) -> bool:
    return (
        _NUMBERS[decimal].fullmatch(cell) is not None
        or cell.lower() in _MARKS
        or _CLOCK.fullmatch(cell) is not None
    )


def _is_number(cell: str, decimal: str) -> bool:
    return _NUMBERS[decimal].fullmatch(cell) is not None


def _dialect(lines: Sequence[str]) -> tuple[str | None, str, int]:
    """Separator, decimal mark and number of columns by which most rows are numbers."""
    # The end may be cut off, the beginning be metadata.
    body = lines[:-1] if len(lines) > 3 else lines
    middle = len(body) // 2
    sample = [*body[middle : middle + _SAMPLE // 2], *body[-_SAMPLE // 2 :]]
    best: tuple[float, int, int] = (0.0, 0, 0)
    chosen: tuple[str | None, str, int] | None = None
    for place, (separator, decimal) in enumerate(_DIALECTS):
        cells = _splitter(separator)
        rows = [cells(line) for line in sample]
        widths: Counter[int] = Counter()
        for row in rows:
            read = sum(_readable(c, decimal) for c in row)
            # Some columns may be remarks beside the first rows.
            if read >= max(1, 0.6 * len(row)) and any(_is_number(c, decimal) for c in row):
                widths[len(row)] += read == len(row) or 0
        if not widths or not max(widths.values()):
            continue
        width, count = widths.most_common(1)[0]
        score = (round(count / len(rows), 1), min(width, 2), -place)
        if (width > 1 or separator is not None) and score > best:
            best, chosen = score, (separator, decimal, width)
    if chosen is None or best[0] < 0.3:
        return _last_resort(lines)
    return chosen


def _last_resort(lines: Sequence[str]) -> tuple[str | None, str, int]:
    """The commonest width by a delimiter, so that a message can name the cell."""
    head = lines[0]
    separator = max((",", ";", "\t"), key=head.count)
    if not head.count(separator):
        raise RecordError("holds no table: a heading and a row for each time are needed")
    return separator, ".", head.count(separator) + 1


def _first_row(numbered: list[tuple[int, str]], cells: Any, decimal: str, width: int) -> int | None:
    """Where the numbers begin."""
    for place, (_, line) in enumerate(numbered):
        row = cells(line)
        if len(row) != width or not _is_row(row, decimal):
            continue
        after = [cells(other) for _, other in numbered[place + 1 : place + 4]]
        if not after or sum(len(r) == width and _is_row(r, decimal) for r in after) * 2 >= len(
            after
        ):
            return place
    return None


def _is_row(row: list[str], decimal: str) -> bool:
    """Whether all cells are numbers, marks or blank, and at least one is a number."""
    return all(_readable(c, decimal) for c in row) and any(
        _is_number(c, decimal) or _CLOCK.fullmatch(c) for c in row
    )


def _whole(line: str, cells: Any, decimal: str, width: int) -> bool:
    row = cells(line)
    return len(row) == width and all(_readable(c, decimal) for c in row)


def _headings(
    above: list[tuple[int, list[str]]], width: int
) -> tuple[list[str], list[str], tuple[int, int]]:
    """Headings and units from the rows next above the numbers, and these rows' lines."""
    blank = [""] * width

    def fitted(row: list[str]) -> list[str] | None:
        while len(row) > width and not row[-1].strip():
            row = row[:-1]
        if len(row) == width + 1 and row[0].endswith(":"):
            row = row[1:]  # "columns: time[us] sent[V]"
        if len(row) == width - 1 and width > 1:
            row = [*row, ""]  # rows that end in a separator
        return list(row) if len(row) == width else None

    rows = [(number, fitted(row)) for number, row in above]
    line, units = rows[-1] if rows else (0, None)
    if units is not None and _all_units(units):
        rows.pop()
    else:
        line, units = 0, blank
    at, heading = rows[-1] if rows else (0, None)
    return heading or blank, [u.strip("()[]{} ") for u in units], (at if heading else 0, line)


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
        if len(row) != width and _is_row(row, decimal):
            raise RecordError(_uneven(number, len(row), width, separator))
    if not above or not is_time(above[-1][1][0]):
        return
    row = list(above[-1][1])
    while len(row) > width and (not row[-1].strip() or _REMARK.match(row[-1])):
        row.pop()
    if len(row) not in (width, width - 1):
        raise RecordError(
            f"row {line} has {width} cells; the heading has {len(row)}: give each column a "
            "heading, and each row a cell for each"
        )


def _all_units(row: list[str]) -> bool:
    said = [c for c in row if c.strip()]
    return bool(said) and all(is_unit(c) for c in said) and len(said) * 2 >= len(row)


def _numbers(
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
        na_values=sorted({form for m in _MARKS for form in (m, m.upper(), m.capitalize())}),
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
        if text.lower() in _MARKS:
            continue
        if _NUMBERS[decimal].fullmatch(text):
            result[r] = float(text.replace(",", ".").replace("D", "e").replace("d", "e"))
        elif _CLOCK.fullmatch(text):
            dated += 1
        else:
            remedy = "correct the cell, or leave it blank for a sample that is missing"
            if any(form.fullmatch(text) for form in _NUMBERS.values()):
                remedy = "rows differ in their decimal mark; write all alike"
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
        if of_day:
            elapsed = pandas.to_timedelta(text)
            return np.asarray((elapsed - elapsed[0]) / pandas.Timedelta(seconds=1), float)
        dates = pandas.to_datetime(text, format="ISO8601", utc=True)
        return np.asarray((dates - dates[0]) / pandas.Timedelta(seconds=1), float)
    except (ValueError, TypeError, OverflowError) as error:
        bad = next((r for r, cell in enumerate(text) if not _CLOCK.fullmatch(cell)), 0)
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
        raise RecordError(_uneven(number, found, width, separator))


def _uneven(number: int, found: int, width: int, separator: str | None) -> str:
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
