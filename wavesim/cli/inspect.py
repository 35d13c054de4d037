"""The command `inspect`: what is wrong with a record, as a table."""

from __future__ import annotations

import sys
import textwrap
from dataclasses import replace
from typing import Any

import click

from wavesim.cli.arguments import INPUT, JSON, RING, SOURCES, print_json, record_options
from wavesim.report.terminal import FELL_SHORT, console, new_table

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

    Exit code 0: some can, as it is or with an option that is named; 1: none can; 2: it can't be
    read.
    """
    from wavesim.records.inspection import inspect as look_over

    found = look_over(file, replace(layout, input=column, sources=places, ring=ring))
    summary = {"file": file} | found.summary()
    if as_json:
        print_json(summary)
    else:
        _show(summary)
    if all(summary["usable"].values()) and not summary["lacking"]:
        sys.exit(FELL_SHORT)


def _show(summary: dict[str, Any]) -> None:
    channels = summary["receivers"]
    x = [c["position_m"] for c in channels]
    where = "positions not known" if None in x else f"x = {min(x):.6g} to {max(x):.6g} m"
    end = summary["start_s"] + summary["interval_s"] * (summary["frames"] - 1)
    unit = ("point" if summary["run"] else "receiver") + ("s" if len(channels) > 1 else "")
    _say(
        f"{summary['file']}: {summary['frames']} frames, {summary['interval_s']:.6g} s apart, from "
        f"{summary['start_s']:.6g} to {end:.6g} s; {len(channels)} "
        f"{unit}, {where}"
    )
    if summary["run"]:
        _say(f"It is {summary['run']}.")
    for assumed in summary["assumed"]:
        _say(f"Assumed: {assumed}.")
    findings = summary["findings"]
    if findings:
        click.echo()
        table = new_table("what", "where", "size", "done", words=4)
        for finding in findings:
            table.add_row(*(str(finding[name]) for name in ("what", "where", "size", "done")))
        console().print(table)
        click.echo()
    else:
        click.echo("Nothing is wrong with it.")
    for command, reason in summary["usable"].items():
        no = "not yet" if command in summary["lacking"] else "no"
        _say(f"{command}: " + (f"{no}: {reason}" if reason else "can use it"))


def _say(text: str) -> None:
    click.echo(textwrap.fill(text, _WIDTH, subsequent_indent="  ", break_on_hyphens=False))
