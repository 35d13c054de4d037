"""The command `wavesim design`: from a wish to a stack that keeps it."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import click

from wavesim.cli.arguments import (
    CASE,
    OUT,
    QUIET,
    SET,
    affordable,
    folder_for,
    longest,
    planned,
    read_case,
    write_json,
    writing,
)
from wavesim.report.terminal import FELL_SHORT, console, new_table

# What T of the time domain may differ by from the exact one.
_AGREES = 1e-3


@click.command(short_help="Find a stack that passes and stops what a case asks.")
@CASE
@OUT
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of the starts.")
@click.option(
    "--at-most",
    metavar="TIME",
    help="Take the best stack after so long; by default 40 s of work or so, 10min at most.",
)
@click.option("--verify", is_flag=True, help="Run the design in the time domain too.")
@QUIET
@SET
def design(
    case: str,
    out: str | None,
    seed: int,
    at_most: str | None,
    verify: bool,
    quiet: bool,
    overrides: tuple[str, ...],
) -> None:
    """Find the stack that [design] of CASE asks for: design.toml, design.json, design.png.

    design.toml is a case that wavesim run takes as it is. Exit code 1 if a wish can't be kept.
    """
    from wavesim.timedomain.compiled import keep_compiled

    folder = folder_for(out, case)
    shown, allowed = console(quiet), longest(at_most) if at_most else None
    keep_compiled()
    from wavesim.report.progress import working
    from wavesim.studies.design import design as designed
    from wavesim.verdict.cell_size import serves

    begun = False

    with working("design", quiet) as say:

        def tell(stage: str, short: float) -> None:
            nonlocal begun
            if not begun:  # what can't be written into is told before the search
                with writing(folder):
                    begun = True
            kept = f"; one wish lacks {short:.3g} dB yet" if short else "; all wishes kept"
            say(stage + (kept if short < float("inf") else ""))

        found = designed(case, seed, overrides, allowed, serves, tell)
    answer = found.summary()
    with writing(folder):
        (folder / "design.toml").write_text(found.text, encoding="utf-8")
        write_json(folder / "design.json", answer)
        _draw(found, folder)
    _tell(shown, found)
    agrees = True
    if verify:
        agrees = _verify(shown, folder, answer)
        write_json(folder / "design.json", answer)
    shown.print(f"design.toml, design.json and design.png in {folder}")
    if not (found.met and agrees):
        sys.exit(FELL_SHORT)


def _draw(found: Any, folder: Path) -> None:
    """T over the bands and about them, with the mask."""
    import dataclasses

    from wavesim.case.layered_case import bar_layers
    from wavesim.case.schema import parse
    from wavesim.figures.bar import transmission_figure
    from wavesim.figures.style import write
    from wavesim.studies.transmission_study import transmission_study

    wishes = found.problem.wishes
    low, high = min(w.low for w in wishes), max(w.high for w in wishes)
    band = max(0.5 * low, low - 0.25 * (high - low)), high + 0.1 * (high - low)
    known = bar_layers(parse(found.text, "design.toml"), "design.toml")
    study = transmission_study(known, band, 800)
    own = {wish.sector for wish in wishes}
    curves = {sector: curve for sector, curve in study.curves.items() if sector in own}
    study = dataclasses.replace(study, curves=curves)
    write({"design": lambda: transmission_figure(study)}, folder)


def _tell(shown: Any, found: Any) -> None:
    from wavesim.case.units import unit_of

    table = new_table("wish", "from kHz", "to kHz", "dB", "reached", "")
    for wish, level, short in zip(found.problem.wishes, found.reached, found.short, strict=True):
        kind = "at most" if wish.most else "at least"
        table.add_row(
            f"{wish.sector} {kind}", f"{wish.low / 1e3:g}", f"{wish.high / 1e3:g}",
            f"{wish.limit:g}", f"{level:.2f}", "kept" if short == 0 else f"lacks {short:.2f} dB",
        )  # fmt: skip
    shown.print(table)
    variables = new_table("variable", "value", "may be off")
    may = found.offsets or [None] * len(found.values)
    for key, value, off in zip(found.problem.keys, found.values, may, strict=True):
        unit = unit_of(key.name)
        variables.add_row(key.key, f"{value:.6g} {unit}".rstrip(), _may(off, unit))
    shown.print(variables)
    length = found.problem.length(found.values)
    shown.print(f"{length * 1e3:.4g} mm between the half-spaces.")
    if found.met:
        shown.print(
            f"Of designs whose variables are off by up to {100 * found.problem.tolerance:g} %, "
            f"{100 * found.made:.3g} % keep every wish."
        )
    else:
        wishes = ", ".join(
            f"{w.sector} {w.low / 1e3:g}–{w.high / 1e3:g} kHz" for w in found.problem.wishes
        )
        shown.print(
            "No stack was found that keeps every wish: "
            + found.why
            + "more layers, variables or length may, or another --seed. "
            f"What else can be had, in dB ({wishes}):"
        )
        levels = (", ".join(f"{v:.2f}" for v in row["reached"]) for row in found.trade_off)
        for line in dict.fromkeys(levels):
            shown.print(f"  {line}")
    shown.print(f"{found.evaluations} stacks from {found.starts} starts, {found.seconds:.1f} s.")


def _may(off: Any, unit: str) -> str:
    """How far a variable may be off; of a value of 0 in its unit."""
    if off is None:
        return ""
    size, word = (1.0, unit) if off.absolute else (100.0, "%")
    return f"−{size * off.down:.2g} +{size * off.up:.2g} {word}".rstrip()


def _verify(shown: Any, folder: Path, answer: dict[str, Any]) -> bool:
    """Run the design; whether its T is the exact one, at ω + iσ where the source drives it."""
    from wavesim import runner
    from wavesim.report.progress import progress

    case = str(folder / "design.toml")
    loaded = read_case(case)
    taken = affordable(case, loaded, planned(case, loaded), "1h", folder / "run")
    with progress(loaded.simulation.frames, shown.quiet, taken.stages) as tell:
        outcome = runner.run(loaded, folder / "run", progress=tell)
    checks = [c for c in outcome.summary["checks"] if "T: |ΔT|" in c["name"]]
    agrees = bool(checks) and all(check["measured"] <= _AGREES for check in checks)
    answer["verified"] = {"agrees": agrees, "checks": checks}
    for check in checks:
        shown.print(f"Time domain, {check['name']}: {check['measured']:.2e}")
    verdict = "agrees with" if agrees else "differs from" if checks else "does not tell"
    shown.print(f"T of the time domain {verdict} the exact one, to {_AGREES:g}.")
    if not checks:
        for note in outcome.notes:
            shown.print(f"Note: {note}.")
    shown.print(f"Its page: {folder / 'run' / 'report.html'}")
    return agrees
