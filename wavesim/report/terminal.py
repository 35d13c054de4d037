"""What every command shares: the console, and the one message that ends a failed one."""

from __future__ import annotations

import sys
from typing import Any, NoReturn

import click

FELL_SHORT, BAD_INPUT = 1, 2


def stop(message: str, code: int) -> NoReturn:
    """End with one line on standard error and an exit code."""
    click.echo(f"wavesim: {message}", err=True)
    sys.exit(code)


def console(quiet: bool = False) -> Any:
    """A console as wide as the terminal, or 80 columns where there is none."""
    from rich.console import Console

    width = None if sys.stdout.isatty() else 80
    # Without markup: [time] in a message is a table of the case file.
    return Console(quiet=quiet, highlight=False, markup=False, width=width)
