"""Transmission and reflection of what lies between two buffers, from the field in them.

In a uniform buffer the field is U(x) = a e^{ik(x−x₀)} + b e^{−ik(x−x₀)} at each ω + iσ, with the
buffer's own k(ω + iσ); a and b by least squares over all nodes of a stretch. With x₀ at the faces
of the specimen, R = b/a in front of it and T = a behind over a before.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wavesim.layered.transmission import specimen as between
from wavesim.material.family import Block
from wavesim.material.layers import Layers
from wavesim.planewave.dispersion_relation import wavenumber
from wavesim.readings.bar.excited_band import JUDGED, contour, line, pulses
from wavesim.readings.bar.loudness import Loudness
from wavesim.readings.damped_transform import damped_transform
from wavesim.simulation.field import Field

if TYPE_CHECKING:  # what draws a run reads no case file
    from wavesim.case.schema import BandTable

Complex = NDArray[np.complex128]

# Branch lengths that a fit keeps away from a source, a face and an absorber.
_AWAY = 2.0
_FEWEST_NODES = 8
# To this part of the incident wave T and R are told.
TOLD = 1e-4
# Frequencies of a band of one's choice, at ω + iσ.
_IN_BAND = 33
# Ends of a band that differ by less are the same.
_SAME = 1e-12


@dataclass(frozen=True)
class Band:
    """A band of one's choice, and what the exact solver says of it at real ω.

    Attributes:
        asked: the band with its limits.
        highest, lowest: level of T in it, dB, and where, Hz; NaN where there is no answer.
    """

    asked: BandTable
    highest: tuple[float, float]
    lowest: tuple[float, float]

    def holds(self, omega: NDArray[Any]) -> NDArray[np.bool_]:
        """Which frequencies (rad/s) lie in it."""
        ends = np.array([self.asked.low, self.asked.high]) * 2 * np.pi
        return np.asarray((omega >= ends[0] * (1 - _SAME)) & (omega <= ends[1] * (1 + _SAME)))


@dataclass(frozen=True)
class Buffers:
    """What a specimen lies between, and frequencies at which it is looked at.

    Attributes:
        sector: of the wave.
        before, behind: nodes of the buffers that are looked at.
        faces: where the first buffer ends and the last begins, m.
        k: the buffers' wavenumbers at ω + iσ, shape (n,) each, rad/m.
        omega: real part of the frequencies, shape (n,), rad/s.
        sigma: their imaginary part σ, rad/s.
        judged: where the source has more than 1 % of its peak spectrum and the wave in the buffers
            propagates, shape (n,).
    """

    sector: str
    before: slice
    behind: slice
    faces: tuple[float, float]
    k: tuple[Complex, Complex]
    omega: NDArray[Any]
    sigma: float
    judged: NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True)
class Specimen(Buffers):
    """What lies between two buffers, and what is known of it before any field is.

    Attributes:
        T_exact, R_exact: of the exact solver at ω + iσ, at the faces, shape (n,): what is measured
            of a record is compared there.
        line: ω, T and R once more on a line fine enough to be drawn, and T at real ω there.
        T_real, R_real: of the exact solver at real ω, which a stack is judged by as a filter, shape
            (n,); NaN where a graded layer without losses has its asymptote, and there is none.
        bands: those that are asked for in this sector.
    """

    T_exact: Complex
    R_exact: Complex
    line: tuple[NDArray[Any], Complex, Complex, Complex]
    T_real: Complex
    R_real: Complex
    bands: tuple[Band, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Scattered(Specimen):
    """What a specimen lets through and sends back, measured, beside what is known of it.

    Attributes:
        T, R: measured amplitude ratios of φ, at the specimen's faces, shape (n,).
        judged: where they count, and the incident wave stands so far above what the record's end
            and rounding may add that T and R can be told to 1e-4.
    """

    T: Complex
    R: Complex


def amplitudes(transform: Complex, x: Any, k: Complex) -> tuple[Complex, Complex]:
    """a and b of a e^{ikx} + b e^{−ikx}, least squares at each frequency; transform (n, nodes)."""
    found = []
    for values, wave in zip(transform, k, strict=True):
        # Each column to a largest entry of 1, as the waves grow or decay along the stretch.
        design = np.stack([np.exp(1j * wave * x), np.exp(-1j * wave * x)], axis=1)
        size = np.abs(design).max(axis=0)
        found.append(np.linalg.lstsq(design / size, values, rcond=None)[0] / size)
    a, b = np.array(found).T
    return a, b


def _stretch(field: Field, low: float, high: float) -> slice | None:
    """Nodes within a stretch, away from its ends; None if they are too few."""
    away = _AWAY * float(field.medium.length_scale)
    nodes = field.bar.nodes
    first, last = np.searchsorted(nodes, [low + away, high - away])
    return slice(int(first), int(last)) if last - first >= _FEWEST_NODES else None


def buffers(
    field: Field,
    block: Block,
    frequencies: int,
    damping: float,
    bands: Sequence[BandTable] = (),
) -> Buffers | None:
    """The first and the last layer of a bar, where a specimen lies between them.

    Args:
        field: of a bar with two absorbing ends and two layers or more, its sources in the first;
            no value of it is looked at.
        block: one with a macro-field.
        frequencies: number of frequencies.
        damping: σT of the exponential window.
        bands: those to be judged, of any sector.

    Returns:
        None where the bar is no such bar, or its buffers are too short.
    """
    layers, bar = field.layers, field.bar
    if (bar.left, bar.right) != ("absorbing", "absorbing"):
        return None
    first, last = layers.layers[0], layers.layers[-1]
    own = pulses(field, block)
    if len(layers.layers) < 2 or first.last is not None or last.last is not None or not own:
        return None
    if any(source.position > first.end for source in own):
        return None
    low, high = bar.clear
    source_end = max(source.position + 8.5 * source.width for source in own)
    before = _stretch(field, source_end, first.end)
    behind = _stretch(field, last.start, high)
    if before is None or behind is None or source_end < low:
        return None
    asked = [band for band in bands if band.sector == block.sector]
    also = [2 * np.pi * np.linspace(band.low, band.high, _IN_BAND) for band in asked]
    omega, sigma, size = contour(field, own, frequencies, damping, also)
    s, faces = omega + 1j * sigma, (first.end, last.start)
    k, other = (wavenumber(layer.medium, block.sector, s) for layer in (first, last))
    carried = np.all([np.abs(wave.imag) < np.abs(wave.real) for wave in (k, other)], axis=0)
    judged = (size >= JUDGED) & carried
    return Buffers(block.sector, before, behind, faces, (k, other), omega, sigma, judged)


def specimen(
    field: Field,
    block: Block,
    frequencies: int,
    damping: float,
    bands: Sequence[BandTable] = (),
) -> Specimen | None:
    """What is known of a specimen between buffers; arguments and None as of :func:`buffers`."""
    looked = buffers(field, block, frequencies, damping, bands)
    if looked is None:
        return None
    layers, omega, sigma = field.layers, looked.omega, looked.sigma
    turn, stands = 2 * np.pi, between(layers)
    s = omega + 1j * sigma
    fine = turn * stands.with_resonances(block.sector, line(omega, sigma) / turn)
    T, R = exact_scattering(layers, block.sector, np.concatenate([s, fine + 1j * sigma]))
    real = stands.at_real(block.sector, np.concatenate([omega, fine]))
    count = len(omega)
    return Specimen(
        **vars(looked),
        T_exact=T[:count],
        R_exact=R[:count],
        line=(fine, T[count:], R[count:], real.T[count:]),
        T_real=real.T[:count],
        R_real=real.R[:count],
        bands=tuple(
            Band(band, *stands.extremes(block.sector, band.low, band.high))
            for band in bands
            if band.sector == block.sector
        ),
    )


def scattered(
    field: Field, block: Block, known: Specimen, loud: Loudness | None = None
) -> Scattered:
    """Measure what a specimen lets through and sends back.

    Args:
        field: of a bar with a specimen.
        block: one with a macro-field.
        known: of :func:`specimen`.
        loud: of the same field; made where None.
    """
    loud = loud or Loudness(field)
    omega, sigma = known.omega, known.sigma
    (name,) = block.macro[0]
    ends, hidden = [], 0.0
    for nodes, face, wave in zip((known.before, known.behind), known.faces, known.k, strict=True):
        record = field.part(name, points=nodes)
        transform = damped_transform(record, field.t, omega, sigma)
        ends.append(amplitudes(transform, field.bar.nodes[nodes] - face, wave))
        hidden = max(hidden, loud.hidden(record, sigma, name))
    (a, b), (c, _) = ends
    judged = known.judged & (np.abs(a) * TOLD >= hidden)
    with np.errstate(divide="ignore", invalid="ignore"):  # where nothing came there is no ratio
        T, R = c / a, b / a
    return Scattered(**vars(known) | {"judged": judged}, T=T, R=R)


def exact_scattering(layers: Layers, sector: str, omega: Complex) -> tuple[Complex, Complex]:
    """T and R of what lies between the first and the last layer, at its faces.

    Args:
        layers: of the bar, its buffers uniform.
        sector: of the wave.
        omega: ω + iσ, shape (n,), rad/s.
    """
    found = between(layers).amplitudes(sector, omega)
    return found.T, found.R
