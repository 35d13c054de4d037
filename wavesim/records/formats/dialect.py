"""How a text file is written: its encoding, what parts its cells, its decimal mark, its marks.

The delimiter and the decimal mark are those by which most rows of the body are numbers.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Callable, Sequence

from wavesim.records.content import RecordError

# Marks of a sample out of range, and of one that is not there.
_OUT_OF_RANGE = """ol +ol -ol o.l. o.l overload over +over -over over+ over- overflow ovf ovfl ovrld
    ∞ -∞ +∞ inf -inf +inf infinity -infinity clip clipped sat saturated underflow under range
    1.#inf -1.#inf *** ****"""
_NOT_THERE = """nan -nan na n/a #n/a null none nil - -- --- missing bad err error #value! #num!
    #div/0! 1.#qnan -1.#ind 1.#nan ?"""
OVERLOAD = frozenset(_OUT_OF_RANGE.split())
MARKS = OVERLOAD | {"", *_NOT_THERE.split()}
# Thousands may be parted, by what can't be a decimal mark there.
NUMBERS = {
    mark: re.compile(
        rf"[-+−]?(?:(?:\d+{re.escape(mark)}?\d*|{re.escape(mark)}\d+)(?:[eEdD][-+]?\d+)?"
        rf"|[1-9]\d{{0,2}}(?:(?:[ '’\u00a0\u202f]\d{{3}})+(?:{re.escape(mark)}\d*)?"
        rf"|(?:{re.escape(other)}\d{{3}})+{re.escape(mark)}\d*|(?:{re.escape(other)}\d{{3}}){{2,}}))"
    )
    for mark, other in (".,", ",.")
}
CLOCK = re.compile(
    r"(?:\d{4}[-/]\d\d?[-/]\d\d?|\d\d?[./]\d\d?[./]\d{4})(?:[T ]\d\d?:\d\d(?::\d\d(?:[.,]\d+)?)?)?"
    r"(?:Z|[+-]\d\d:?\d\d)?|(?:-?\d+ days? [+-]?)?\d\d?:\d\d:\d\d(?:[.,]\d+)?"
)
# Most likely first: of those that read as many rows the first is taken.
_DIALECTS = (("\t", "."), (";", "."), (";", ","), (",", "."), ("|", "."), ("\t", ","), (None, "."),
             (None, ","), (",", ","))  # fmt: skip
# What begins with a longer mark begins with the shorter one too.
_MARKED = ((b"\xef\xbb\xbf", "utf-8-sig"), (b"\xff\xfe\0\0", "utf-32"), (b"\0\0\xfe\xff", "utf-32"),
           (b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16"))  # fmt: skip
_SAMPLE = 80


def decoded(raw: bytes) -> str:
    """The text of a file's bytes.

    Raises:
        RecordError: they are no text.
    """
    name = _wide(raw)
    if name:
        try:
            return raw.decode(name)
        except UnicodeDecodeError as error:
            raise RecordError(f"can't be read as text: {error}") from None
    if b"\0" in raw[:100_000]:
        raise RecordError(
            "can't be read as text: it holds bytes that no text has; give it the suffix of what "
            "it is (.npz, .h5, .mat, .nc, .segy, .sac, .mseed)"
        )
    try:
        return raw.decode("utf-8")
    except UnicodeDecodeError:
        text = raw.decode("cp1252", "replace")
        # Three letters with accents in a row are Cyrillic ones.
        return raw.decode("cp1251", "replace") if re.search("[À-ÿ]{3}", text) else text


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


def splitter(separator: str | None) -> Callable[[str], list[str]]:
    """What parts a line into cells; None parts them at spaces."""
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


def readable(cell: str, decimal: str) -> bool:
    """Whether a cell is a number, a mark, or a date or time of day."""
    return (
        NUMBERS[decimal].fullmatch(cell) is not None
        or cell.lower() in MARKS
        or CLOCK.fullmatch(cell) is not None
    )


def is_number(cell: str, decimal: str) -> bool:
    """Whether a cell is a number."""
    return NUMBERS[decimal].fullmatch(cell) is not None


def dialect(lines: Sequence[str]) -> tuple[str | None, str, int]:
    """Separator, decimal mark and number of columns by which most rows are numbers."""
    # The end may be cut off, the beginning be metadata.
    body = lines[:-1] if len(lines) > 3 else lines
    middle = len(body) // 2
    sample = [*body[middle : middle + _SAMPLE // 2], *body[-_SAMPLE // 2 :]]
    best: tuple[float, int, int] = (0.0, 0, 0)
    chosen: tuple[str | None, str, int] | None = None
    for place, (separator, decimal) in enumerate(_DIALECTS):
        cells = splitter(separator)
        rows = [cells(line) for line in sample]
        widths: Counter[int] = Counter()
        for row in rows:
            read = sum(readable(c, decimal) for c in row)
            # Some columns may be remarks beside the first rows.
            if read >= max(1, 0.6 * len(row)) and any(is_number(c, decimal) for c in row):
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


def is_row(row: list[str], decimal: str) -> bool:
    """Whether all cells are numbers, marks or blank, and at least one is a number."""
    return all(readable(c, decimal) for c in row) and any(
        is_number(c, decimal) or CLOCK.fullmatch(c) for c in row
    )
