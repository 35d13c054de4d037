"""Options of every command that reads a record: what the file does not say for itself."""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Callable
from typing import Any

import click

from wavesim.report.terminal import BAD_INPUT, stop

_OPTIONS = (
    click.option("--values", metavar="NAME", help="Array of the record in the file."),
    click.option("--time", metavar="NAME", help="Array of its times."),
    click.option("--positions", metavar="NAME|X1,X2,…",
                 help="Array of its receivers' positions, or the positions themselves, in m."),
    click.option("--interval", type=float, help="Δt in s; stands before the file's times."),
    click.option("--spacing", type=float,
                 help="Receiver spacing in m; stands before the file's positions."),
    click.option("--time-unit", metavar="UNIT", help="Of the file's times: s, ms, us, ns …"),
    click.option("--position-unit", metavar="UNIT", help="Of the file's positions: m, mm, in …"),
)  # fmt: skip
NAMES = ("values", "time", "positions", "interval", "spacing", "time_unit", "position_unit")


def record_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command these options; it gets them as one argument, ``layout``.

    Other parts of a layout (sources, input, ring …) are the command's own:
    ``dataclasses.replace(layout, input=column)``.
    """

    @functools.wraps(function)
    def command(**given: Any) -> Any:
        said = {name: given.pop(name) for name in NAMES}
        return function(layout=layout(said), **given)

    for option in reversed(_OPTIONS):
        command = option(command)
    return command


def layout(said: dict[str, Any]) -> Any:
    """The layout that options say; a wrong one ends the command with a line."""
    from wavesim.records.arrays import Layout
    from wavesim.records.content import RecordError

    positions = said.get("positions")
    if positions is not None:
        parts = [part for part in positions.replace(";", ",").split(",") if part.strip()]
        with contextlib.suppress(ValueError):  # else it is the name of an array
            said = said | {"positions": tuple(float(part) for part in parts)}
    try:
        return Layout(**said)
    except RecordError as error:
        stop(str(error), BAD_INPUT)
