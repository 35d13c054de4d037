"""The command `inspect`: what is wrong with a record, as a table."""

from __future__ import annotations

import sys
import textwrap
from dataclasses import replace
from typing import Any

import click

from wavesim.cli.arguments import INPUT, JSON, RING, SOURCES, record_options
from wavesim.cli.shared import print_json
from wavesim.report.terminal import FELL_SHORT

_WIDTH = 80


@click.command(short_help="What is wrong with a record, and what can use it.")
@click.argument("file", type=click.Path())
@JSON
@INPUT
@SOURCES
@RING
@record_options
def inspect(
    file: str,
    as_json: bool,
    column: str | None,
    places: tuple[float, ...],
    ring: bool,
    layout: Any,
) -> None:
    """What is wrong with the record FILE, what was done about it, and which commands can use it.

    Exit code 0: some can; 1: none can; 2: it can't be read.
    """
    from wavesim.records.inspection import inspect as look_over

    found = look_over(file, replace(layout, input=column, sources=places, ring=ring))
    summary = {"file": file} | found.summary()
    if as_json:
        print_json(summary)
    else:
        _show(summary)
    if all(summary["usable"].values()):
        sys.exit(FELL_SHORT)


def _show(summary: dict[str, Any]) -> None:
    channels = summary["receivers"]
    x = [c["position_m"] for c in channels]
    where = "positions not known" if None in x else f"x = {min(x):.6g} to {max(x):.6g} m"
    end = summary["start_s"] + summary["interval_s"] * (summary["frames"] - 1)
    _say(
        f"{summary['file']}: {summary['frames']} frames, {summary['interval_s']:.6g} s apart, from "
        f"{summary['start_s']:.6g} to {end:.6g} s; {len(channels)} "
        f"{'points' if summary['run'] else 'receivers'}, {where}"
    )
    if summary["run"]:
        _say(f"It is {summary['run']}.")
    for assumed in summary["assumed"]:
        _say(f"Assumed: {assumed}.")
    findings = summary["findings"]
    if findings:
        click.echo()
        _table(findings)
        click.echo()
    else:
        click.echo("Nothing is wrong with it.")
    for command, reason in summary["usable"].items():
        _say(f"{command}: " + (f"no: {reason}" if reason else "can use it"))


def _say(text: str) -> None:
    click.echo(textwrap.fill(text, _WIDTH, subsequent_indent="  ", break_on_hyphens=False))


def _table(findings: list[dict[str, Any]]) -> None:
    names = ("what", "where", "size", "done")
    widths = {n: max(len(n), *(len(f[n]) for f in findings)) for n in names}
    # What does not fit is folded within its column.
    for name, most in (("what", 18), ("size", 24), ("done", 9)):
        widths[name] = min(widths[name], most)
    widths["where"] = min(
        widths["where"], _WIDTH - 6 - widths["what"] - widths["size"] - widths["done"]
    )
    for row in [dict(zip(names, names, strict=True)), None, *findings]:
        if row is None:
            click.echo("  ".join("-" * widths[n] for n in names))
            continue
        cells = [textwrap.wrap(str(row[n]), widths[n]) or [""] for n in names]
        for line in range(max(map(len, cells))):
            parts = [(c[line] if line < len(c) else "").ljust(widths[n])
                     for c, n in zip(cells, names, strict=True)]  # fmt: skip
            click.echo("  ".join(parts).rstrip())
