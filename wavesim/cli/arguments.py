"""What several commands take: a case, and values laid over it."""

from __future__ import annotations

import click

from wavesim.cli.completion import cases, keys

CASE = click.argument("case", type=click.Path(), shell_complete=cases)
SET = click.option(
    "--set",
    "overrides",
    multiple=True,
    metavar="TABLE.KEY=VALUE",
    shell_complete=keys,
    help="Lay a value over the case's, such as bar.order=10 or sources.0.field='\"phi2\"'.",
)
