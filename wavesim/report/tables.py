"""What the terminal shows, as tables: the verdict, the bands, what is known before a run; fits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from wavesim.case.load import Case
from wavesim.grid.bar import Bar
from wavesim.material.damping import quality
from wavesim.material.family import sector_words
from wavesim.material.layers import Layers
from wavesim.material.scaling import scales
from wavesim.material.shown import KHZ, in_time, with_error
from wavesim.report.answers import (
    answers,
    measured_and_allowed,
    short_name,
)
from wavesim.report.answers import verdict as sentence
from wavesim.report.terminal import new_table
from wavesim.simulation.simulation import Simulation, highest_carried, largest_phase
from wavesim.sources import Source
from wavesim.timedomain.cost import Cost
from wavesim.timedomain.time_step import TimeStep

if TYPE_CHECKING:  # slow to import, and for most commands nothing but a name
    from wavesim.readings.misfit import Comparison
    from wavesim.verdict.foreseen_errors import Foretold

_MOST_LAYERS = 8
# Checks that fell short, of which the terminal tells.
_MOST_SHORT = 12
# Columns that fit into 80 characters only side by side.
_MANY = 8
# Of what is held so many are named that are this part of the error that it makes.
_MOST, _COUNTS = 4, 0.2


def found(console: Console, summary: dict[str, Any]) -> None:
    """Print what a run found, of its summary.json: gaps, velocities, T, Q, beside exact values."""
    for answer in answers(summary):
        columns = answer.columns
        table = new_table(*(column.name for column in columns))
        console.print(answer.title, style="italic")  # a table would break it at its own width
        if len(columns) >= _MANY:
            table.padding = (0, 0)
        for one, column in zip(table.columns, columns, strict=True):
            one.no_wrap = bool(column.kind)  # words may be broken, digits never cut off
        units = [column.unit for column in columns]
        if any(units):
            table.add_row(*units, style="dim")
        for row in answer.rows:
            table.add_row(*(column.shown(row) for column in columns))
        console.print(table)
        if answer.note:
            console.print(answer.note, style="dim")
            console.print()


def verdict(console: Console, summary: dict[str, Any]) -> None:
    """Print the verdict of a run in a line, then what fell short."""
    console.print(sentence(summary), soft_wrap=True)
    show_short(console, [check for check in summary["checks"] if not check["passed"]])


def show_short(console: Console, short: Sequence[dict[str, Any]]) -> None:
    """Print checks that fell short, and once what to change."""
    for remedy in dict.fromkeys(check.get("remedy", "") for check in short):
        alike = [check for check in short if check.get("remedy", "") == remedy]
        names = [short_name(check["name"]) for check in alike[:_MOST_SHORT]]
        told = ", ".join(dict.fromkeys(names)) + (f": {remedy}." if remedy else "")
        console.print(Text("FAIL", "bold red"), told, soft_wrap=True)
        for check, name in zip(alike, names, strict=False):
            measured, allowed = measured_and_allowed(check)
            console.print(f"     {name} is {measured}, allowed {allowed}", soft_wrap=True)
        if len(alike) > _MOST_SHORT:
            console.print(f"     and {len(alike) - _MOST_SHORT} more; the page has all")


def survey(
    console: Console,
    case: Case,
    steps: TimeStep,
    taken: Cost,
    errors: Sequence[Foretold] | None,
) -> None:
    """Print what can be said of a case before integrating; errors of the grid are None where they
    are too much to work out."""
    simulated = case.simulation
    medium, bar, layers = simulated.medium, simulated.bar, simulated.layers
    frames, frame = simulated.frames, simulated.interval
    carried = highest_carried(simulated.layers, bar) / 1e3
    seconds = steps.step * float(scales(medium).time)
    rows = [
        ("title", case.title or "–"),
        ("medium", f"{medium.in_words}; ω̄ = 1 is "
                   f"{KHZ / medium.time_scale:.5g} kHz"),
        *([("layers", _layers(layers))] if len(layers.layers) > 1 else []),
        ("losses", _losses(layers)),
        ("bar", f"{bar.length:.6g} m, {bar.cells} cells of {bar.spacing:.4g} m "
                f"({medium.length_scale / bar.spacing:.3g} to a branch length), order {bar.order}"),
        ("ends", _ends(bar)),
        ("grid carries", f"to 1 % of their phase, waves of {_shortest(bar):.2g} cells and longer: "
                         f"the fastest to {carried:.0f} kHz, slower ones less"),
        ("grid's errors", _errors(simulated, errors)),
        ("sources", ", ".join(map(_source, simulated.sources))),
        ("integrated", ", ".join(simulated.fields)),
        ("time", f"{simulated.duration:.6g} s, {frames} frames of {frame:.4g} s (Nyquist "
                 f"{0.5e-3 / frame:.5g} kHz), frequency bin {1e-3 / simulated.duration:.4g} kHz"),
        ("stepper", f"{steps.solver}, {steps.steps} steps of {seconds:.4g} s; "
                    f"{steps.operator_products} products"),
        ("judged", f"k = {case.k_range[0]:.5g} to {case.k_range[1]:.5g} rad/m, every "
                   f"{2 * math.pi / bar.length:.4g} rad/m" if simulated.endless
                   else "receivers, against the exact solution in the frequency domain"),
        ("takes", taken.in_words),
    ]  # fmt: skip
    table = Table(box=None, show_header=False, pad_edge=False)
    for name, text in rows:
        table.add_row(Text(name, "bold"), text)
    console.print(table)


def _layers(layers: Layers) -> str:
    shown = [
        f"{layer.start * 1e3:.6g} to {layer.end * 1e3:.6g} mm{', graded' if layer.last else ''}"
        for layer in layers.layers[:_MOST_LAYERS]
    ]
    more = len(layers.layers) - len(shown)
    return "; ".join(shown) + (f"; and {more} more" if more else "")


def _losses(layers: Layers) -> str:
    laws = dict.fromkeys(layer.medium.damping for layer in layers.layers if layer.medium.damping)
    if not laws:
        return "none"
    told = []
    for law in laws:
        parts = [f"α = {law.mass:g} 1/s"] if law.mass else []
        parts += [f"β = {law.stiffness:g} s"] if law.stiffness else []
        if law.rates:
            middle = math.sqrt(law.rates[0] * law.rates[-1])
            parts.append(
                f"Q = {float(quality(law, middle)):.4g} at {middle * KHZ:.4g} kHz, "
                f"{len(law.rates)} relaxations"
            )
        told.append(", ".join(parts))
    return "; ".join(told)


def _ends(bar: Bar) -> str:
    if bar.periodic:
        return "periodic"
    long = f" over {bar.absorber * 1e3:g} mm"
    return ", ".join(
        f"{side} {end}{long if end == 'absorbing' else ''}"
        for side, end in (("left", bar.left), ("right", bar.right))
    )


def _errors(simulated: Simulation, errors: Sequence[Foretold] | None) -> str:
    """Of each kind of what is judged the worst, beside what is allowed."""
    from wavesim.verdict.foreseen_errors import untold

    worst: dict[float, Foretold] = {}
    for one in errors or ():
        if one.error >= worst.get(one.allowed, one).error:
            worst[one.allowed] = one
    told = [
        f"{one.what} off by {one.error:.1e} (allowed {one.allowed:g})" for one in worst.values()
    ]
    told += [missing] if (missing := untold(simulated, errors)) else []
    return "; ".join(told) or "nothing is judged that they would show in"


def _shortest(bar: Bar) -> float:
    """Cells to the shortest wave that the grid carries."""
    return 2 * math.pi / largest_phase(bar.order)


def _source(source: Source) -> str:
    peak = source.peak_frequency
    at = f", {peak / 1e3:.5g} kHz" if math.isfinite(peak) else ""
    kind = "" if source.kind == "ricker" else f"{source.kind} on "
    return f"{kind}{source.field} at {source.position:g} m{at}"


def bands(
    console: Console, rows: Sequence[dict[str, Any]], full_gaps: Sequence[Any], bar_hz: float
) -> None:
    """Print the branches and gaps of a medium.

    Args:
        console: where to.
        rows: of ``wavesim.planewave.bands.table``.
        full_gaps: [(lower, upper)] in Hz and ω̄: (low, high, low_bar, high_bar).
        bar_hz: frequency of ω̄ = 1, Hz.
    """
    table = new_table("sector", "branch", "cutoff", "asymptote", "gap", "", "", words=2)
    table.padding, table.show_edge = (0, 0), False
    for column in table.columns:
        column.no_wrap = True
    # Two digits of a kHz are enough for the fast waves of grains, and none of slow ones.
    unit, scale = ("kHz", 1e3) if max(row["cutoff_hz"] for row in rows) >= 1e3 else ("Hz", 1.0)

    def shown(hertz: float | None) -> str:
        return "rises" if hertz is None else f"{hertz / scale:.2f}"

    table.add_row("", "", unit, unit, "", unit, "ω̄", style="dim")
    for row in rows:
        gap = row["gap"]
        table.add_row(
            sector_words(*row["sector"].split(", ")),
            row["branch"],
            shown(row["cutoff_hz"]),
            shown(row["asymptote_hz"]),
            gap or "",
            f"{shown(row['gap_lower_hz'])} – {shown(row['gap_upper_hz'])}" if gap else "",
            f"{row['gap_lower_bar']:.3f} – {row['gap_upper_bar']:.3f}" if gap else "",
        )
    console.print(table)
    if not full_gaps:
        console.print("At every frequency some wave propagates.")
    for low, high, low_bar, high_bar in full_gaps:
        console.print(
            f"None of these waves propagates between {shown(low)} and {shown(high)} {unit} "
            f"(ω̄ {low_bar:.4f} – {high_bar:.4f})."
        )
    console.print(f"ω̄ = 1 is {bar_hz / scale:.5g} {unit}.")


def show_comparison(console: Console, found: Comparison) -> None:
    """Print what is left, in parts."""
    scale, unit = in_time(max((abs(one.arrival) for one in found.receivers), default=0.0))
    headings = "position (mm)", "left over", f"later by ({unit})", "larger by", "spectrum (dB)"
    table = new_table("receiver", *headings)
    for one in found.receivers:
        table.add_row(
            one.name, f"{one.position * 1e3:.5g}", f"{one.residual:.2%}",
            f"{one.arrival * scale:.4g}", f"× {one.amplitude:.4g}", f"{one.spectrum:.2g}",
        )  # fmt: skip
    console.print(table)
    time, word = in_time(found.lag)
    console.print(f"lag {with_error(found.lag * time, found.lag_error * time, word)}")
    scale_of = with_error(found.scale, found.scale_error)
    console.print(f"scale {scale_of}, unit of the record over that of {found.measured.field}")
    console.print(f"left over {found.residual:.3%} of the record's rms")
    for note in found.notes:
        console.print(f"Note: {note}.", markup=False)


def show_fit(console: Console, answer: dict[str, Any]) -> None:
    """Print a fit; of a series, a line for each state."""
    if "series" in answer:
        _show_states(console, answer)
        return
    known_to, moves = answer["held"]["known_to"], answer["held"]["moves_by_1_percent"]
    for key, one in answer["parameters"].items():
        if one["value"] is None:
            console.print(f"{key}: no answer: {one['reason']}.", markup=False)
            continue
        console.print(f"{key} = {_fitted(one)}", markup=False)
        moved = {} if known_to else moves.get(key, {})
        least = _COUNTS * _number(one["error"])
        most = sorted(moved, key=lambda name: -abs(moved[name]))[:_MOST]
        counts = [name for name in most if abs(moved[name]) > least]
        if counts:
            console.print(f"  most by {', '.join(counts)}", markup=False)
        if one["reason"]:
            console.print(f"  does not count: {one['reason']}.", markup=False)
    for key, one in answer["nuisances"].items():
        error = _number(one["error"])
        size = max(abs(one["value"]), 0.0 if math.isnan(error) else error)
        scale, unit = in_time(size) if key == "lag" else (1.0, "")
        told = with_error(one["value"] * scale, error * scale, unit) if unit else None
        console.print(f"{key} {told or with_error(one['value'], error)}", markup=False)
    if any(one["error"] is not None for one in answer["parameters"].values()):
        how = "to 1 %, or exactly in brackets: say by --held how well it is"
        if known_to:
            how = ", ".join(f"{name} to {p:.3g}".strip() for name, p in known_to.items())
        console.print(f"± is one standard error, what is not varied known {how}.", markup=False)
    for pair in answer["correlations"]:
        a, b = pair["keys"]
        value = with_error(pair["told"], pair["told_error"], "s" if a == "lag" else "")
        told = f"; told is {a} {pair['factor']:+.4g} × {b} = {value}"
        tied = f"Errors of {a} and {b} hang together: correlation {pair['value']:.4f}"
        console.print(f"{tied}{told}.", markup=False)
    if answer["kind"] == "waveforms":
        console.print(f"left over {answer['residual']:.3%} of the record's rms, "
                      f"{answer['evaluations']} solutions")  # fmt: skip
    for note in answer["notes"]:
        console.print(f"Note: {note}.", markup=False)


def _fitted(one: dict[str, Any]) -> str:
    """A value with its error, and what that is where what is held is exact."""
    told = with_error(one["value"], _number(one["error"]))
    alone, beside = _number(one["error_if_held_exact"]), 1 - _COUNTS**2
    less = alone < beside * _number(one["error"])
    return f"{told} (± {alone:.2g} by the data alone)" if less else told


def _number(value: float | None) -> float:
    return math.nan if value is None else value


def _show_states(console: Console, answer: dict[str, Any]) -> None:
    name = answer["parameter"]
    for row in answer["series"]:
        found = {key.partition(".")[2]: one for key, one in row.items() if key != "parameter"}
        why = next((one["reason"] for one in found.values() if one["reason"]), "")
        told = [f"{k} = {_fitted(v)}" for k, v in found.items() if v["value"] is not None]
        console.print(f"{name} = {row['parameter']:g}: {why or ', '.join(told)}", markup=False)
    if law := answer["law"]:
        power = f"{law['b']:.3f} ± {law['b_error']:.2g}"
        console.print(f"K_n_a = {law['c']:.4g} · {name}^({power})", markup=False)
    for note in answer["notes"]:
        console.print(f"Note: {note}.", markup=False)
