"""Text of a file that somebody names; samples of a signal in one, held to what a source can be made
of."""

from __future__ import annotations

import os
import stat
from collections.abc import Sequence
from pathlib import Path

import numpy as np

# Larger ones take longer to read than anybody waits; a minute of a signal at 10 kHz has 15 MB.
_LARGEST = 64_000_000


def text_of(path: Path, what: str) -> str:
    """The text of a regular file in UTF-8, with or without a byte-order mark.

    Args:
        path: of the file.
        what: it should be, for messages, such as "a case file".

    Raises:
        ValueError: it isn't there, can't be read, is no regular file (which might never end), is
            too long, or isn't text; the message says which, and what to do.
    """
    try:
        found = os.stat(path)
        if not stat.S_ISREG(found.st_mode):
            kind = "a folder" if stat.S_ISDIR(found.st_mode) else "a device, pipe or socket"
            raise ValueError(f"is {kind}, no regular file; name {what}")
        if found.st_size > _LARGEST:
            raise ValueError(
                f"{found.st_size / 1e6:.0f} MB, more than {_LARGEST / 1e6:.0f} MB; name {what}"
            )
        with open(path, "rb") as file:
            data = file.read(_LARGEST + 1)
    except FileNotFoundError:
        raise ValueError(f"no such file; name {what}") from None
    except OSError as error:
        raise ValueError(f"can't be read: {error.strerror}; name {what}") from None
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise ValueError(
            f"line {line}: not text in UTF-8 ({error.reason}); save it as UTF-8, or name {what}"
        ) from None


FEWEST_SAMPLES = 8
# A record begins and ends within this part of its peak.
_FOOT = 1e-2
# Times are even to this part of the record, and to this part of a sample.
_EVEN, _EVEN_SAMPLE = 1e-6, 1e-2


def check_samples(
    times: Sequence[float], values: Sequence[float], lines: Sequence[int] | None = None
) -> None:
    """Hold samples to what a source can be made of.

    Args:
        times: s.
        values: any unit.
        lines: of the file that each came from, for messages; None counts samples from 1.

    Raises:
        ValueError: too few, not finite, not rising, with a gap, all zero, or cut off at an end; the
            message names sample or line, value and remedy.
    """

    def where(n: int) -> str:
        return f"sample {n + 1}" if lines is None else f"line {lines[n]}"

    t, v = np.array(times), np.array(values)
    if len(t) != len(v):
        raise ValueError(f"times: {len(t)} given for {len(v)} values; give one each")
    if len(t) < FEWEST_SAMPLES:
        raise ValueError(f"{len(t)} samples: at least {FEWEST_SAMPLES} are needed; record more")
    for name, column in (("t", t), ("value", v)):
        bad = np.nonzero(~np.isfinite(column))[0]
        if len(bad):
            raise ValueError(
                f"{where(bad[0])}: {name} = {column[bad[0]]}: must be finite; fill it in by "
                "interpolation, or cut the record"
            )
    steps = np.diff(t)
    back = np.nonzero(steps <= 0)[0]
    if len(back):
        n = back[0] + 1
        raise ValueError(
            f"{where(n)}: t = {t[n]:.9g}: must be after t = {t[n - 1]:.9g}; sort the record by "
            "time and drop what is there twice"
        )
    usual = float(np.median(steps))
    gap = np.nonzero(steps > 1.5 * usual)[0]
    if len(gap):
        n = gap[0] + 1
        raise ValueError(
            f"{where(n)}: t = {t[n]:.9g}: a gap of {steps[n - 1]:.4g} s, where samples are "
            f"{usual:.4g} s apart; fill it in by interpolation, or cut the record there"
        )
    even = np.linspace(t[0], t[-1], len(t))
    off = np.abs(t - even)
    n = int(np.argmax(off))
    if off[n] > max(1e-14 * abs(t).max(), min(_EVEN * (t[-1] - t[0]), _EVEN_SAMPLE * usual)):
        raise ValueError(
            f"{where(n)}: t = {t[n]:.9g}: samples must be even in time, here t = {even[n]:.9g}; "
            "resample the record evenly"
        )
    peak = np.abs(v).max()
    if peak == 0:
        raise ValueError("values: all are 0, so that nothing moves; check the column")
    for n in (0, len(v) - 1):
        if abs(v[n]) > _FOOT * peak:
            raise ValueError(
                f"{where(n)}: value = {v[n]:.4g}: the record must begin and end within "
                f"{_FOOT:g} of its peak {peak:.4g}; take off its mean and taper it"
            )


def read_csv(path: Path) -> tuple[list[float], list[float]]:
    """Read a signal from a file of two columns, t in s and value.

    Columns are parted by a comma, a semicolon or white space; empty lines, lines that begin with
    #, and one line of headings are skipped.

    Returns:
        Times and values.

    Raises:
        ValueError: it can't be read, or can't be used; the message names line, value and
            remedy.
    """
    text = text_of(path, "a CSV file; its path is taken from the case file's folder")
    times: list[float] = []
    values: list[float] = []
    lines: list[int] = []
    headed = False
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        parts = line.replace(";", ",").split(",") if "," in line or ";" in line else line.split()
        try:
            if len(parts) != 2:
                raise ValueError
            t, value = (float(part) for part in parts)
        except ValueError:
            if not (times or headed) and not any(map(_number, parts)):
                headed = True
                continue
            raise ValueError(
                f"line {number}: {line.strip()[:40]!r}: must be two numbers, t in s and value; "
                "fill it in or cut the record"
            ) from None
        times.append(t)
        values.append(value)
        lines.append(number)
    check_samples(times, values, lines)
    return times, values


def _number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
