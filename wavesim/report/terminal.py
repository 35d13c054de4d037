"""What every command shares: the console, and the one message that ends a failed one."""

from __future__ import annotations

import errno
import os
import sys
import traceback
from typing import Any, NoReturn

import click

# Exit codes: a check of the run fell short; bad input; the integration or the writing of its
# results failed; interrupted.
FELL_SHORT, BAD_INPUT, FAILED, INTERRUPTED = 1, 2, 3, 130
_LONGEST = 2000


def told(message: str, kind: str = "") -> None:
    """One line on standard error, in which nothing is left that a terminal would obey."""
    from wavesim.material.shown import printable  # loads numpy, which --help does without

    text = printable(message, _LONGEST)
    click.echo(f"wavesim: {kind}: {text}" if kind else f"wavesim: {text}", err=True)


def stop(message: str, code: int) -> NoReturn:
    """End with one line on standard error and an exit code."""
    told(message)
    sys.exit(code)


def failed(error: BaseException) -> int:
    """What is said of an error that no command foresaw, in one line, and the exit code.

    With WAVESIM_TRACEBACK=1 in the environment its traceback is printed too.
    """
    if isinstance(error, KeyboardInterrupt):
        told("interrupted")
        return INTERRUPTED
    if os.environ.get("WAVESIM_TRACEBACK"):
        traceback.print_exception(error)
    if type(error).__module__.startswith("wavesim."):  # one of ours says what to do
        told(str(error))
        return getattr(error, "code", BAD_INPUT)
    name, why = type(error).__name__, str(error).partition("\n")[0]
    if isinstance(error, MemoryError):
        told(f"it does not fit into memory ({why or name}); take fewer cells, or fewer frames")
    elif isinstance(error, OSError):
        where = f"{error.filename}: " if error.filename else ""
        told(f"{where}can't be read or written: {error.strerror or why}")
    else:
        told(
            f"it failed in a way that was not foreseen ({name}: {why}); "
            "WAVESIM_TRACEBACK=1 in the environment shows where"
        )
    return FAILED


def unwritable(
    error: OSError, where: object, remedy: str = "name another folder"
) -> tuple[str, int]:
    """What is said where something can't be written, and the exit code: of bad input, but where the
    disk is full, of a failure."""
    from wavesim.io.whole_files import way_out

    full = error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EIO)
    first = way_out(error)
    said = f"{where}: can't be written: {error.strerror or error}; "
    said += f"{first}, or {remedy}" if first else remedy
    return said, FAILED if full else BAD_INPUT


def console(quiet: bool = False) -> Any:
    """A console as wide as the terminal; where there is none, as $COLUMNS, or else 80 columns."""
    from rich.console import Console

    columns = os.environ.get("COLUMNS", "")
    width = int(columns) if columns.isdecimal() and int(columns) else 80
    # Without markup: [time] in a message is a table of the case file.
    return Console(
        quiet=quiet, highlight=False, markup=False, width=None if sys.stdout.isatty() else width
    )


def new_table(*headings: str, words: int = 1) -> Any:
    """A table to print: words in its first columns, which may be broken, and numbers in the others,
    whose digits never are: where it is too wide it goes on below, with its words again."""
    from rich import box

    from wavesim.report.number_table import NumberTable

    made = NumberTable(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    for number, heading in enumerate(headings):
        word = number < words
        made.add_column(
            heading, justify="left" if word else "right", no_wrap=not word, overflow="fold"
        )
    return made
