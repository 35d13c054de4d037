"""Rows that tell of the gaps of media, and of what each receiver has of them: exact, no grid."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wavesim.material.medium import Medium
from wavesim.material.shown import DECIBELS, HERTZ
from wavesim.planewave.dispersion_relation import Gap, open_gaps, wavenumber
from wavesim.simulation.field import Field
from wavesim.verdict.remedies import Answers, Row, to_see_more

# Media whose gaps are told, at most.
_MOST_MEDIA = 3


def gap_row(gap: Gap) -> Row:
    """A gap by its name, its sector and its edges, Hz."""
    edges = {"lower": gap.lower * HERTZ, "upper": gap.upper * HERTZ}
    return {"gap": gap.name, "sector": gap.sector, **edges}


def steady_loss(medium: Medium, sector: str, omega: float) -> Row:
    """What a steady wave loses at a frequency (rad/s) in a gap.

    Returns:
        "attenuation_at_real_frequency": Im k(ω), dB/m; "twenty_decibels_within": the distance on
        which that is 20 dB, m.
    """
    decay = float(wavenumber(medium, sector, np.array([omega]))[0].imag) * DECIBELS
    within = 20 / decay if decay > 0 else None
    return {"attenuation_at_real_frequency": decay, "twenty_decibels_within": within}


def of_media(field: Field) -> Answers:
    """The gaps of each medium of a bar, in waves that the run has and that travel.

    Returns:
        "gaps": name, sector, layers that have it, edges and middle (Hz), :func:`steady_loss` there,
        and what to set to drive it; "receivers" of :func:`at_receivers`. Nothing of more than three
        media, nor of graded ones.
    """
    layers = field.layers.layers
    media = list(dict.fromkeys(layer.medium for layer in layers))
    if field.layers.graded or len(media) > _MOST_MEDIA:
        return {}
    sectors = dict.fromkeys(block.sector for block in field.blocks)
    rows: list[Row] = []
    for medium in media:
        own = [str(n) for n, layer in enumerate(layers, start=1) if layer.medium == medium]
        of = f"layer {', '.join(own)}" if len(media) > 1 else "the bar"
        for sector in (one for one in sectors if one in medium.family.travelling):
            for gap in open_gaps(medium, sector):
                middle = (gap.lower + gap.upper) / 2
                told = {"medium": of, "frequency": middle * HERTZ}
                closer = to_see_more(field, sector, gap) if len(media) == 1 else ""
                loss = steady_loss(medium, sector, middle)
                rows.append({**gap_row(gap), **told, **loss, "closer": closer})
    return {"gaps": rows, **at_receivers(field, rows)} if rows else {}


def at_receivers(field: Field, gaps: Sequence[Row]) -> Answers:
    """How far down each receiver is in the middle of each gap, in a bar of one medium.

    Args:
        field: the field.
        gaps: rows with :func:`steady_loss`.

    Returns:
        "receivers": the name, the distance to the nearest source (m), the shorter way round a ring,
        and by the name of each gap −(distance · attenuation) (dB); the nearest first.
    """
    key, bar = "attenuation_at_real_frequency", field.bar
    decays = {row["gap"]: row[key] for row in gaps if row[key] is not None}
    if not decays or len(field.layers.media) > 1:
        return {}
    rows = []
    for name, position in field.receivers.items():
        away = np.array([abs(position - source.position) for source in field.sources])
        far = float((np.minimum(away, bar.length - away) if bar.periodic else away).min())
        rows.append({"receiver": name, "distance": far} | {g: -far * a for g, a in decays.items()})
    return {"receivers": sorted(rows, key=lambda row: row["distance"])} if rows else {}
