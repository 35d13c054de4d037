"""What stands between two half-spaces: a bar's layers but the first and the last, which these are.

Reference planes are the specimen's faces.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np

from wavesim.layered.transmission import Transmission, transmission
from wavesim.material.layers import Layer, Layers
from wavesim.planewave.band_edges import asymptotes
from wavesim.planewave.complex_wavenumber import wavenumber

# Next to the asymptotes of a graded layer without losses, in this part of ω, nothing is told.
MARGIN = 2e-3
# Frequencies at which a band is looked at: evenly, below asymptotes (parts of them), and about so
# many turning points.
_IN_BAND, _BELOW, _TURNS, _NEAR = 801, np.geomspace(1e-6, 3e-2, 300), 16, 17


@dataclass(frozen=True)
class Specimen:
    """A specimen and the half-spaces beside it.

    Attributes:
        layers: the specimen between slivers of the half-spaces.
        sliver: their thickness, m.
    """

    layers: Layers
    sliver: float

    @property
    def inside(self) -> tuple[Layer, ...]:
        """The layers between the half-spaces."""
        return self.layers.layers[1:-1]

    def amplitudes(self, sector: str, omega: Any) -> Transmission:
        """T, R and power coefficients at real or complex ω, planes at the faces.

        Raises:
            ValueError: as :func:`~wavesim.layered.transmission.transmission`.
        """
        exact = transmission(self.layers, sector, omega)
        first, last = self.layers.layers[0], self.layers.layers[-1]
        with np.errstate(over="ignore", invalid="ignore"):  # at a half-space's own asymptote
            back, on = (
                np.exp(-1j * wavenumber(layer.medium, sector, omega) * self.sliver)
                for layer in (first, last)
            )
        return dataclasses.replace(
            exact,
            T=exact.T * back * on,
            R=exact.R * back**2,
            T_back=exact.T_back * back * on,
            R_back=exact.R_back * on**2,
        )

    def at_real(self, sector: str, omega: Any) -> tuple[Transmission, Any]:
        """The same at real ω, and where there is an answer, shape (n,).

        There is none where a graded layer without losses has its asymptote at ω: waves pile up
        there, and where they go is left to whatever loss there is. Values are NaN then.

        Args:
            sector: with a macro-field.
            omega: real, shape (n,), rad/s.
        """
        open_ = np.ones(len(omega), dtype=bool)
        for layer in self.inside:
            if layer.last is None or layer.medium.damping:
                continue
            edges = np.stack([asymptotes(medium, sector) for medium in layer.sampled()])
            for low, high in zip(edges.min(axis=0), edges.max(axis=0), strict=True):
                open_ &= (omega < low * (1 - MARGIN)) | (omega > high * (1 + MARGIN))
        found = self.amplitudes(sector, omega[open_])

        def spread(value: Any) -> Any:
            whole = np.full(len(omega), np.nan, dtype=np.asarray(value).dtype)
            whole[open_] = value
            return whole

        parts = {name: spread(value) for name, value in vars(found).items() if name != "omega"}
        return Transmission(omega, **parts), open_

    def extremes(self, sector: str, low: float, high: float) -> tuple[Any, Any]:
        """Highest and lowest 20 log₁₀|T| of a band at real ω.

        Args:
            sector: with a macro-field.
            low, high: the band, Hz.

        Returns:
            ((level, dB, where, Hz) of the highest, of the lowest), over 801 frequencies, and more
            where it may be narrow; NaN where there is no answer somewhere in it.
        """
        media = {medium for layer in self.inside for medium in layer.ends}
        # Below an asymptote waves are short, and resonances narrow, by losses no less than 1/Q.
        below = np.concatenate([_below(medium, sector) for medium in media] or [np.empty(0)])
        frequency = np.union1d(
            np.linspace(low, high, _IN_BAND), below[(below > low) & (below < high)]
        )
        level = self._levels(sector, frequency)
        # Then about its highest and lowest turning points.
        last, near = len(level) - 1, list[Any]()
        for height in (level, -level):
            padded = np.concatenate([[-np.inf], height, [-np.inf]])
            turns = np.flatnonzero((height >= padded[:-2]) & (height >= padded[2:]))
            turns = turns[np.argsort(-height[turns], kind="stable")][:_TURNS]
            sides = frequency[np.maximum(turns - 1, 0)], frequency[np.minimum(turns + 1, last)]
            near.append(np.linspace(*sides, _NEAR).ravel())
        more = np.concatenate(near)
        frequency = np.append(frequency, more)
        level = np.append(level, self._levels(sector, more))
        ends = int(np.argmax(level)), int(np.argmin(level))
        highest, lowest = ((float(level[n]), float(frequency[n])) for n in ends)
        return highest, lowest

    def _levels(self, sector: str, frequency: Any) -> Any:
        exact, _ = self.at_real(sector, 2 * np.pi * frequency)
        return 20 * np.log10(np.maximum(np.abs(exact.T), 1e-300))


def _below(medium: Any, sector: str) -> Any:
    """Frequencies below a medium's asymptotes, Hz; of its losses' share of ω and further."""
    edges = asymptotes(medium, sector)
    lossless = medium.damping.lossless(edges)
    return np.concatenate(
        [
            edge / (2 * np.pi) * (1 - _BELOW[share <= _BELOW])
            for edge, share in zip(edges, np.abs(lossless.imag / lossless.real), strict=True)
        ]
    )


def specimen(layers: Layers) -> Specimen:
    """The specimen of a bar.

    Raises:
        ValueError: there are fewer than two layers, or the first or the last is graded.
    """
    own = layers.layers
    if len(own) < 2:
        raise ValueError("nothing stands between half-spaces: at least two layers are needed")
    first, last = own[0], own[-1]
    if first.last is not None or last.last is not None:
        raise ValueError(
            "the first and the last layer stand for half-spaces, and one is graded; put a uniform "
            "layer beside it"
        )
    # The exact solver has its planes at the ends of what it is given: half-spaces of no length.
    sliver = 1e-6 * min(first.thickness, last.thickness)
    cut = [Layer(0.0, sliver, first.medium)]
    for layer in own[1:-1]:
        start = cut[-1].end
        cut.append(Layer(start, start + layer.thickness, layer.medium, layer.last, layer.grading))
    cut.append(Layer(cut[-1].end, cut[-1].end + sliver, last.medium))
    return Specimen(Layers(tuple(cut)), sliver)
