"""``wavesim score``: points held against the truth of a synthetic record."""

from __future__ import annotations

import json
from pathlib import Path

import click

from wavesim.report.terminal import BAD_INPUT, console, stop


@click.command()
@click.argument("truth", type=click.Path())
@click.argument("points", type=click.Path())
@click.option("--k-max", type=click.FloatRange(0, min_open=True),
              help="Highest wavenumber at which waves can be missed, rad/m.")  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def score(truth: str, points: str, k_max: float | None, as_json: bool) -> None:
    """Hold the points of POINTS.csv against the record TRUTH.npz that synthesize made.

    POINTS has columns k and omega (rad/m, rad/s; or frequency in Hz) and perhaps error, one
    standard error; or what dispersion and attenuation write with --out.
    """
    from wavesim.records.content import RecordError
    from wavesim.records.files import read
    from wavesim.records.point_table import read_points
    from wavesim.verdict.score import points_of
    from wavesim.verdict.score import score as held

    try:
        record = read(Path(truth))
        columns = read_points(points)
        found = points_of(columns["k"], columns["omega"], columns.get("error"),
                          columns.get("valid"))  # fmt: skip
    except RecordError as error:
        stop(str(error), BAD_INPUT)
    try:
        result = held(record, found, k_max)
    except RecordError as error:
        stop(f"{truth}: {error}", BAD_INPUT)
    if as_json:
        click.echo(json.dumps(result.row()))
        return
    shown = console()
    shown.print(result.said() + ".")
