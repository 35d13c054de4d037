"""T and R of a case's layers at real frequencies, without a simulation, as data. No jax."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from wavesim.case.layered_case import BarLayers
from wavesim.case.schema import BandTable
from wavesim.layered.transmission import Specimen, Transmission, specimen
from wavesim.material.shown import decibels, plain
from wavesim.planewave.band_edges import asymptotes, gaps

POINTS = 400
# Where the band begins and ends by default, over the first asymptote of the half-spaces.
_FROM, _TO = 0.05, 0.99
# T of thick stacks is exact far below what a picture shows.
level = partial(decibels, least=1e-300)


@dataclass(frozen=True)
class Study:
    """What layers let through.

    Attributes:
        title: of the case.
        specimen: with the half-spaces.
        frequency: of all curves, Hz, shape (n,).
        curves: T and R at real ω of each sector in which waves travel; planes at the specimen's
            faces. NaN where there is no answer, as ``Specimen.at_real`` says.
        gaps: [(layers by number from 1, sector, name, lower, upper edge in Hz)], of each medium.
        bands: of each band that the case asks for what it is, and the highest and the lowest level
            of T in it, (dB, Hz).
    """

    title: str
    specimen: Specimen
    frequency: Any
    curves: dict[str, Transmission]
    gaps: tuple[tuple[str, str, str, float, float], ...]
    bands: tuple[tuple[BandTable, tuple[float, float], tuple[float, float]], ...] = ()

    @property
    def too_low(self) -> str | None:
        """A note where the band is far below what the half-spaces carry, as kHz taken for Hz is."""
        low, high = (float(self.frequency[n]) for n in (0, -1))
        usual = default_band(self.specimen)
        if high >= usual[0]:
            return None
        return (
            f"{low:g} to {high:g} Hz is far below the half-spaces' first band, which goes to "
            f"{usual[1] / 1e3:.4g} kHz; if kHz was meant, take --band {low:g}kHz {high:g}kHz"
        )

    @property
    def notes(self) -> list[str]:
        """What a reader should know beside the numbers."""
        found = [self.too_low] if self.too_low else []
        ends = [self.specimen.layers.layers[n].medium for n in (0, -1)]
        if any(medium.damping for medium in ends):
            found.append(
                "a half-space has losses, so that what comes in carries no energy of its own: "
                "T and R are amplitudes at the faces, and there is no energy"
            )
        for sector, curve in self.curves.items():
            told = np.isfinite(curve.T)
            dark = told & ~np.isfinite(curve.power_T)
            if dark.any() and not any(medium.damping for medium in ends):
                found.append(
                    f"{sector}: in {_spans(self.frequency, dark)} the half-space that the "
                    "wave comes from has a gap; nothing travels there"
                )
            if not told.all():
                found.append(
                    f"{sector}: in {_spans(self.frequency, ~told)} a graded layer "
                    "without losses has its asymptote, where waves pile up, and there is no "
                    "answer; give it a quality_factor, or look at a run, at ω + iσ"
                )
        return found

    def summary(self) -> dict[str, Any]:
        """All of it as JSON has it; what is not a number is null."""
        sectors = {
            sector: {
                "frequency": self.frequency,
                "T": curve.T,
                "R": curve.R,
                "T_dB": level(curve.T),
                "R_dB": level(curve.R),
                "transmitted": curve.power_T,
                "reflected": curve.power_R,
            }
            for sector, curve in self.curves.items()
        }
        edges = [
            {"layers": where, "sector": sector, "name": name, "lower": low, "upper": high}
            for where, sector, name, low, high in self.gaps
        ]
        bands = [
            band.model_dump(by_alias=True)
            | {"highest": highest[0], "lowest": lowest[0]}
            | {"kept": kept(band, highest[0], lowest[0])}
            for band, highest, lowest in self.bands
        ]
        found = {"title": self.title, "sectors": sectors, "gaps": edges, "bands": bands}
        return dict(plain(found | {"notes": self.notes}))

    def table(self) -> tuple[list[str], Any]:
        """Headings and columns for a CSV file."""
        heads, columns = ["frequency_Hz"], [self.frequency]
        for sector, curve in self.curves.items():
            for name, value in (
                ("T_real", curve.T.real),
                ("T_imag", curve.T.imag),
                ("R_real", curve.R.real),
                ("R_imag", curve.R.imag),
                ("T_dB", level(curve.T)),
                ("R_dB", level(curve.R)),
                ("transmitted", curve.power_T),
                ("reflected", curve.power_R),
            ):
                heads.append(f"{sector}_{name}")
                columns.append(value)
        return heads, np.stack(columns, axis=1)


def transmission_study(
    known: BarLayers, band: tuple[float, float] | None = None, points: int = POINTS
) -> Study:
    """T and R of a case's layers between its first and its last.

    Args:
        known: its material.
        band: lowest and highest frequency, Hz; by default what the half-spaces' first band holds.
        points: number of frequencies, evenly spaced, both ends among them.

    Raises:
        ValueError: there is nothing between half-spaces, or no such band.
    """
    if known.layers is None:
        raise ValueError("layers: there are none to be passed; add [[layers]]")
    own = specimen(known.layers)
    family = known.medium.family
    low, high = band or default_band(own)
    if not 0 < low < high < np.inf:
        raise ValueError(f"band {low:g} {high:g}: must be two frequencies in Hz, 0 < F1 < F2")
    frequency = np.linspace(low, high, points)
    first = {sector: family.first_alike(sector) for sector in family.travelling}
    found = {sector: own.at_real(sector, 2 * np.pi * frequency) for sector in set(first.values())}
    curves = {sector: found[alike] for sector, alike in first.items()}
    for asked in known.bands:
        if asked.sector not in family.travelling:
            raise ValueError(
                f'[[analysis.bands]] sector = "{asked.sector}": must be one of '
                f"{', '.join(family.travelling)}; in others nothing travels"
            )
    judged = [(one, *own.extremes(one.sector, one.low, one.high)) for one in known.bands]
    return Study(known.title, own, frequency, curves, tuple(_gaps(known)), tuple(judged))


def kept(band: BandTable, highest: float, lowest: float) -> bool:
    """Whether levels (dB) are within a band's limits."""
    most = np.inf if band.at_most is None else band.at_most
    least = -np.inf if band.at_least is None else band.at_least
    return bool(highest <= most and lowest >= least)


def default_band(own: Specimen) -> tuple[float, float]:
    """Frequencies that the half-spaces' first band holds, Hz."""
    ends = [own.layers.layers[n].medium for n in (0, -1)]
    edge = max(
        float(asymptotes(medium, sector)[0])
        for medium in ends
        for sector in medium.family.travelling
    )
    return _FROM * edge / (2 * np.pi), _TO * edge / (2 * np.pi)


def _gaps(known: BarLayers) -> list[tuple[str, str, str, float, float]]:
    """Open gaps of every medium of the bar, with the layers that have it."""
    media: dict[Any, list[str]] = {}
    places = [".".join(place.where) for place in known.places]
    alike = set(known.stretches[0].ends) == set(known.stretches[-1].ends)
    places[0] = "half-spaces" if alike else "left half-space"
    places[-1] = "half-spaces" if alike else "right half-space"
    for layer, name in zip(known.stretches, places, strict=True):
        for medium in layer.ends:
            media.setdefault(medium, []).append(name)
    found = []
    for medium, names in media.items():
        where = _listed(list(dict.fromkeys(names)))
        for sector in medium.family.sectors:
            found += [
                (where, sector, gap.name, gap.lower / (2 * np.pi), gap.upper / (2 * np.pi))
                for gap in gaps(medium, sector)
                if gap.upper > gap.lower
            ]
    return found


def _listed(names: list[str]) -> str:
    """As "layers.0, layers.2", cut where it is long."""
    shown = ", ".join(names[:3])
    return f"{shown}, …" if len(names) > 3 else shown


def _spans(frequency: Any, chosen: Any) -> str:
    """As "300 to 420 and 510 to 530 kHz"."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], chosen, [False]])))
    spans = [
        f"{frequency[a] / 1e3:.4g} to {frequency[b - 1] / 1e3:.4g}"
        for a, b in zip(edges[::2], edges[1::2], strict=True)
    ]
    return f"{', '.join(spans)} kHz"
