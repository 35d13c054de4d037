"""What several commands take and do: options, a case read, results written, printed as JSON."""

from __future__ import annotations

import csv
import functools
import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

from wavesim.report.terminal import BAD_INPUT, stop, unwritable


def cases(context: click.Context, parameter: click.Parameter, begun: str) -> list[CompletionItem]:
    """Names of shipped cases that begin so, and files."""
    from wavesim.case.shipped import shipped

    names = [CompletionItem(name) for name in shipped() if name.startswith(begun)]
    return [*names, CompletionItem(begun, type="file")]


def keys(context: click.Context, parameter: click.Parameter, begun: str) -> list[CompletionItem]:
    """Keys of the case file's tables that begin so, as --set takes them."""
    from wavesim.case.schema import CaseFile

    found = []
    for name in ("medium", "bar", "time", "analysis"):
        table = CaseFile.model_fields[name].annotation
        found += [f"{name}.{key}=" for key in getattr(table, "model_fields", ())]
    found += [f"sources.0.{key}=" for key in ("field", "position", "peak_frequency", "width")]
    return [CompletionItem(key) for key in found if key.startswith(begun)]


class Number(click.types.FloatParamType):
    """A finite number."""

    name = "float"

    def convert(self, value: Any, param: Any, ctx: Any) -> float:
        """The number, else a line that says what it must be."""
        number: float = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value!r} is no finite number.", param, ctx)
        return number


class NumberIn(Number, click.FloatRange):
    """A finite number within a range."""


NUMBER, POSITIVE, NOT_NEGATIVE = Number(), NumberIn(min=0, min_open=True), NumberIn(min=0)


class Quantity(click.ParamType):
    """A number in SI, or with a unit of its own, as 6e5 or 600kHz.

    Args:
        name: what it is.
        unit: of SI.
        forms: how it may be given.
        positive: whether it must be greater than 0.
    """

    def __init__(self, name: str, unit: str, forms: str, positive: bool = False) -> None:
        self.name, self._unit, self._forms, self._positive = name, unit, forms, positive

    def convert(self, value: Any, param: Any, ctx: Any) -> float:
        """The number in SI, else a line that says how it is given."""
        from wavesim.case.units import meant_by

        known = meant_by(self._unit, str(value))
        if known is None or not math.isfinite(float(known)):
            self.fail(f"{value!r} is no {self.name}; give it as {self._forms}", param, ctx)
        if self._positive and not float(known) > 0:
            self.fail(f"{value}: must be greater than 0", param, ctx)
        return float(known)


FREQUENCY = Quantity("frequency", "Hz", "6e5 (Hz) or 600kHz")
TIME = Quantity("time", "s", "2e-5 (s) or 20us")
LENGTH = Quantity("length", "m", "0.02 (m) or 20mm")
_INTERVAL = Quantity("time", "s", "2e-8 (s) or 20ns", positive=True)
_SPACING = Quantity("length", "m", "0.02 (m) or 20mm", positive=True)


def _ascending(context: Any, option: Any, band: tuple[float, float] | None) -> Any:
    """A band, if it is one."""
    if band is not None and not 0 < band[0] < band[1]:
        said = f"--band {band[0]:g} {band[1]:g}: must be two frequencies in Hz, 0 < F1 < F2"
        stop(said, BAD_INPUT)
    return band


BAND = click.option(
    "--band",
    type=(FREQUENCY, FREQUENCY),
    callback=_ascending,
    metavar="F1 F2",
    help="Lowest and highest frequency, in Hz or as 600kHz.",
)
GAINS = click.option(
    "--gain-error",
    type=NOT_NEGATIVE,
    metavar="PART",
    help="How far gains of receivers differ (rms); else 0.1, or what three show.",
)
CASE = click.argument("case", type=click.Path(), shell_complete=cases)
SET = click.option(
    "--set",
    "overrides",
    multiple=True,
    metavar="TABLE.KEY=VALUE",
    shell_complete=keys,
    help="Lay a value over the case's, such as bar.order=10 or sources.0.field='\"phi2\"'.",
)
# Of one record, whose receivers may stand in several.
FILES = click.argument("files", metavar="FILE…", nargs=-1, required=True, type=click.Path())
JSON = click.option("--json", "as_json", is_flag=True, help="Print one JSON object instead.")
OUT = click.option(
    "-o",
    "--out",
    type=click.Path(),
    help="Folder for results; outputs/<case> by default, of a design outputs/<its folder>_design.",
)
WRITTEN = click.option("-o", "--out", type=click.Path(), help="Folder for numbers and figures.")
QUIET = click.option("--quiet", is_flag=True, help="Print nothing but errors.")
INPUT = click.option(
    "--input",
    "column",
    metavar="COLUMN|FILE",
    help="The transmitter's column: its heading, or its number from 1 (times are 1); 'column 2' "
    "or 'heading 2' where either may be meant; or a file that holds it alone.",
)
SOURCES = click.option(
    "--source", "places", type=LENGTH, multiple=True, help="Position in m or as 20mm."
)
RING = click.option("--ring", is_flag=True, help="Receivers go evenly round a periodic bar.")


def options(*given: Callable[..., Any]) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Several options as one, in this order."""

    def with_them(function: Callable[..., Any]) -> Callable[..., Any]:
        for option in reversed(given):
            function = option(function)
        return function

    return with_them


# Of a command that lays signals of a case beside those of a record.
BESIDE = options(
    click.option(
        "--field",
        metavar="NAME",
        help="What the record is of, such as phi1 or u1, or u1_t, its rate, or u1_tt, the rate of "
        "that; what is driven where not given.",
    ),
    click.option(
        "--lag", type=TIME, help="Of the record's clock, in s or as 20us; fitted where not given."
    ),
    click.option(
        "--scale",
        type=NUMBER,
        help="Unit of the record over that of the field; fitted where not given.",
    ),
)

_OPTIONS = (
    click.option("--values", metavar="NAME", help="Array of the record in the file."),
    click.option("--time", metavar="NAME", help="Array of its times."),
    click.option("--positions", metavar="NAME|X1,X2,…",
                 help="Array of its receivers' positions, or these themselves, in m or as 20mm."),
    click.option("--interval", type=_INTERVAL,
                 help="Δt in s or as 20ns; stands before the file's times."),
    click.option("--spacing", type=_SPACING,
                 help="Receiver spacing in m or as 20mm; stands before the file's positions."),
    click.option("--receivers", type=click.IntRange(min=1),
                 help="How many, where nothing tells which axis of an array is theirs."),
    click.option("--time-unit", metavar="UNIT", help="Of the file's times: s, ms, us, ns …"),
    click.option("--position-unit", metavar="UNIT", help="Of the file's positions: m, mm, in …"),
    click.option("--as-recorded", is_flag=True,
                 help="Hold no channel of a line against the others: none is mended or left out."),
)  # fmt: skip
NAMES = ("values", "time", "positions", "interval", "spacing", "receivers", "time_unit",
         "position_unit", "as_recorded")  # fmt: skip


def record_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command these options; it gets them as one argument, ``layout``.

    Other parts of a layout (sources, input, ring …) are the command's own:
    ``dataclasses.replace(layout, input=column)``.
    """

    @functools.wraps(function)
    def command(**given: Any) -> Any:
        said = {name: given.pop(name) for name in NAMES}
        return function(layout=layout(said), **given)

    return options(*_OPTIONS)(command)


def layout(said: dict[str, Any]) -> Any:
    """The layout that options say."""
    from wavesim.records.layout import Layout

    positions = said.get("positions")
    if positions is not None:
        from wavesim.case.units import meant_by

        parts = [part.strip() for part in positions.replace(";", ",").split(",") if part.strip()]
        meant = [float(v) for v in (meant_by("m", part) for part in parts) if v is not None]
        if len(meant) == len(parts):  # else it is the name of an array
            said = said | {"positions": tuple(meant)}
    return Layout(**said)


def read_case(case: str, overrides: Sequence[str] = ()) -> Any:
    """The case of a file or a name."""
    from wavesim.case.load import load

    return load(case, overrides)


def read_layers(case: str, overrides: Sequence[str] = ()) -> Any:
    """The material alone of a case that need not be one of a simulation."""
    from wavesim.case.layered_case import load_layers

    return load_layers(case, overrides)


def longest(at_most: str) -> float:
    """Of --at-most, s."""
    from wavesim.timedomain.cost import seconds_of

    try:
        return seconds_of(at_most)
    except ValueError as error:
        stop(f"--at-most {at_most}: {error}", BAD_INPUT)


def medium_of(case: str | None, sources: Iterable[Any] = ()) -> Any:
    """The medium of a case; without one that of the first of some sources that knows its own."""
    if case is None:
        return next((s.medium for s in sources if s.medium is not None), None)
    return read_case(case).simulation.medium


def planned(case: str, loaded: Any) -> Any:
    """How the simulation of a case is stepped."""
    from wavesim.case.layered_case import builder
    from wavesim.timedomain.time_step import time_step

    return builder(case)(("time",), time_step, loaded.simulation)


def affordable(case: str, loaded: Any, steps: Any, at_most: str, folder: Path) -> Any:
    """What a run takes, which is refused where it is more than there is, or was allowed."""
    from wavesim.case.layered_case import builder
    from wavesim.timedomain.cost import check_cost, cost

    allowed = longest(at_most)
    taken = cost(loaded.simulation, steps, k_max=loaded.k_range[1] or None)
    builder(case)(("time",), check_cost, loaded.simulation, taken, allowed, folder)
    return taken


def folder_for(out: str | None, case: str) -> Path:
    """Where results go; of a design, which all bear one name, by its folder."""
    path = Path(case)
    name = path.stem
    if path.name == "design.toml" and path.with_name("design.json").exists():
        name = f"{path.resolve().parent.name}_design"
    return Path(out) if out else Path("outputs") / name


@contextmanager
def writing(folder: Path) -> Iterator[None]:
    """A folder that is there; what can't be written into it ends the command with a line."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield
    except OSError as error:
        stop(*unwritable(error, f"--out {error.filename or folder}"))


def print_json(answer: Any) -> None:
    """One line."""
    click.echo(json.dumps(answer, ensure_ascii=False))


def write_json(path: Path, answer: Any, indent: int | None = 1) -> None:
    """The same as a file."""
    text = json.dumps(answer, ensure_ascii=False, indent=indent)
    path.write_text(text + "\n", encoding="utf-8")


def write_columns(path: Path, columns: Mapping[str, Any]) -> None:
    """Columns of any kind as CSV under their names."""
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(columns)
        table.writerows(zip(*columns.values(), strict=True))


def write_table(path: Path, heads: Sequence[str], rows: Any, fmt: str = "%.18e") -> None:
    """Numbers as CSV under a line of headings."""
    import numpy as np

    np.savetxt(path, rows, fmt=fmt, delimiter=",", header=",".join(heads), comments="")
