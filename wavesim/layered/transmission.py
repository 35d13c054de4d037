"""Transmission and reflection of a layered stretch between two half-spaces; of a bar's specimen."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from wavesim.layered.stack import Stack
from wavesim.layered.uniform_layer import Waves
from wavesim.material.family import travelling_block
from wavesim.material.layers import Layer, Layers
from wavesim.material.shown import Shown
from wavesim.planewave.band_edges import asymptotes, keeps_gradient
from wavesim.planewave.complex_wavenumber import wavenumber

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True, repr=False)
class Transmission(Shown):
    """Ratios of macro-field φ, or B of a block without one, and power coefficients at each ω.

    Reference planes are x = 0 (incident and reflected from the left, transmitted to the left) and
    x = L (the other three). Index 0 of the modes is the wave of the closed form k(ω).

    Attributes:
        omega: rad/s, shape (N,).
        T, R: transmitted and reflected over incident φ, from the left, shape (N,).
        T_back, R_back: the same from the right.
        power_T, power_R: energy flux transmitted and reflected over that incident, all modes that
            carry energy together, shape (N,); NaN where the incident wave carries none or ω is
            complex.
        power_T_back, power_R_back: the same from the right.
    """

    omega: Any
    T: Any
    R: Any
    T_back: Any
    R_back: Any
    power_T: Any
    power_R: Any
    power_T_back: Any
    power_R_back: Any

    def told(self) -> dict[str, str]:
        """Frequencies, and the least and the most that is transmitted."""
        power = np.asarray(self.power_T, float)
        told = {"frequencies": str(np.size(self.omega))}
        if np.isfinite(power).any():
            low, high = (10 * np.log10(f(power)) for f in (np.nanmin, np.nanmax))
            told["transmitted energy"] = f"{low:.1f} to {high:.1f} dB"
        return told

    def to_xarray(self) -> xarray.Dataset:
        """All ratios over omega (rad/s)."""
        import xarray

        ratios = {name: ("omega", value) for name, value in vars(self).items() if name != "omega"}
        return xarray.Dataset(ratios, {"omega": ("omega", self.omega, {"units": "rad/s"})})


def _apart(left: Any, right: Any) -> Any:
    """Matrices of the left and of the right end as one that couples neither to the other."""
    none = np.zeros_like(left)
    return np.block([[left, none], [none, right]])


def _primary(of: Waves) -> Any:
    """Index of the wave of the closed form: the one with the smallest |k|, shape (N,)."""
    return np.argmin(np.abs(of.k), axis=1)


def transmission(
    layers: Layers, sector: str, omega: ArrayLike, gradient: bool | None = None
) -> Transmission:
    """What a layered stretch lets through, between half-spaces of its first and its last medium.

    Args:
        layers: the stretch.
        sector: longitudinal, transverse2 or transverse3. Where Γ is kept a block of micro-fields
            alone too, inplane[23], inplane(23) or inplane(22-33): ratios are those of its field.
        omega: ω, shape (N,), real or complex with Im ω ≥ 0, not 0, rad/s.
        gradient: whether Γ is kept; None lets planewave.gradient_share > 1e-9 of a layer decide.

    Returns:
        Amplitude ratios and power coefficients, which sum to 1 without loss.

    Raises:
        ValueError: nothing travels in the sector, ω is 0 or has Im ω < 0, or Γ is singular where it
            is kept.
    """
    frequencies = np.atleast_1d(np.asarray(omega))
    growing = np.flatnonzero(frequencies.imag < 0)
    if len(growing):
        raise ValueError(
            f"omega = {frequencies[growing[0]]:g} rad/s: Im ω must not be below 0, as fields go as "
            "exp(−iωt) here; where yours go as exp(+jωt), give conj(ω) and take conj(T)"
        )
    kept = keeps_gradient(layers, gradient)
    block = travelling_block(layers.first.family, sector, kept)
    stack = Stack(layers, block, frequencies, kept)
    whole = stack.whole().whole
    left, right = stack.end_waves(False), stack.end_waves(True)
    n, rows = len(stack.impedance), np.arange(len(stack.scaled))
    # Waves that come in from the half-spaces and that go out into them: what they are of
    # (a at 0, b at L), which the stretch takes in, and of (b at 0, a at L), which it sends.
    come_in = _apart(left.v + left.f, right.mirror_v - right.mirror_f)
    come_back = _apart(left.v - left.f, right.mirror_v + right.mirror_f)
    go_in = _apart(left.mirror_v + left.mirror_f, right.v - right.f)
    go_out = _apart(left.mirror_v - left.mirror_f, right.v + right.f)
    amplitudes = np.linalg.solve(go_out - whole @ go_in, whole @ come_in - come_back)
    first, last = _primary(left), n + _primary(right)
    # Of the block's first field: as they come in, and as they go out.
    come = np.concatenate([left.v[:, 0], right.mirror_v[:, 0]], axis=1)
    go = np.concatenate([left.mirror_v[:, 0], right.v[:, 0]], axis=1)
    flux = np.concatenate(
        [np.sum((np.conj(w.f) * w.v).real, axis=1) for w in (left, right)], axis=1
    )
    carries = np.concatenate(
        [np.abs(w.k.imag) <= 1e-9 * np.abs(w.k) for w in (left, right)], axis=1
    )
    flux = np.where(carries & (np.asarray(omega, dtype=complex).imag == 0).reshape(-1, 1), flux, 0)

    def amplitude(to: Any, source: Any) -> Any:
        return amplitudes[rows, to, source] * go[rows, to] / come[rows, source]

    def power(side: slice, source: Any) -> Any:
        sent = np.abs(amplitudes[rows, side, source]) ** 2 * flux[:, side]
        incident = flux[rows, source]
        return np.where(
            incident > 0, sent.sum(axis=1) / np.where(incident > 0, incident, 1), np.nan
        )

    to_left, to_right = slice(0, n), slice(n, 2 * n)
    return Transmission(
        omega=stack.omega,
        T=amplitude(last, first),
        R=amplitude(first, first),
        T_back=amplitude(first, last),
        R_back=amplitude(last, last),
        power_T=power(to_right, first),
        power_R=power(to_left, first),
        power_T_back=power(to_left, last),
        power_R_back=power(to_right, last),
    )


# Next to the asymptotes of a graded layer without losses, in this part of ω, nothing is told.
MARGIN = 2e-3
# Frequencies at which a band is looked at: evenly, below asymptotes (parts of them), and about so
# many turning points.
# Even frequencies of a band that stops, its turning points looked at, frequencies about each.
_LOOKED, _TOPS, _NEAR_TOP = 100, 6, 11
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

    def at_real(self, sector: str, omega: Any) -> Transmission:
        """The same at real ω.

        There is no answer where a graded layer without losses has its asymptote at ω: waves pile up
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
        return Transmission(omega, **parts)

    def with_resonances(self, sector: str, frequency: Any) -> Any:
        """Frequencies, ascending, Hz, and between them more below the asymptotes of what stands
        inside: waves are short there, and resonances narrow, by losses no less than 1/Q."""
        media = {medium for layer in self.inside for medium in layer.ends}
        below = np.concatenate([_below(medium, sector) for medium in media] or [np.empty(0)])
        within = (below > frequency[0]) & (below < frequency[-1])
        return np.union1d(frequency, below[within])

    def extremes(self, sector: str, low: float, high: float) -> tuple[Any, Any]:
        """Highest and lowest 20 log₁₀|T| of a band at real ω.

        Args:
            sector: with a macro-field.
            low, high: the band, Hz.

        Returns:
            ((level, dB, where, Hz) of the highest, of the lowest), over 801 frequencies, and more
            where it may be narrow; NaN where there is no answer somewhere in it.
        """
        frequency = self.with_resonances(sector, np.linspace(low, high, _IN_BAND))
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

    def peaks_within(self, sector: str, bands: Sequence[tuple[float, float]]) -> tuple[Any, Any]:
        """What may pass within bands that stop: 20 log₁₀|T| at real ω at even frequencies of each
        and, twice closer, about its highest turning points there.

        Args:
            sector: with a macro-field.
            bands: (lowest, highest), Hz.

        Returns:
            Frequencies, Hz, and levels, dB, of all.
        """
        nets = [np.linspace(*band, _LOOKED) for band in bands]
        levels = self._levels(sector, np.concatenate(nets)).reshape(len(bands), -1)
        net = [*zip(nets, levels, strict=True)]
        for _ in range(2):
            near = []
            for frequency, level in net:
                padded = np.concatenate([[-np.inf], level, [-np.inf]])
                turns = np.flatnonzero((level >= padded[:-2]) & (level >= padded[2:]))
                turns = turns[np.argsort(-level[turns], kind="stable")][:_TOPS]
                last = len(level) - 1
                sides = frequency[np.maximum(turns - 1, 0)], frequency[np.minimum(turns + 1, last)]
                near.append(np.linspace(*sides, _NEAR_TOP)[1:-1].ravel())
            found = self._levels(sector, np.concatenate(near))
            parts = np.split(found, np.cumsum([len(one) for one in near])[:-1])
            both = zip(net, near, parts, strict=True)
            merged = [(np.append(f, a), np.append(v, b)) for (f, v), a, b in both]
            net = [(f[n], v[n]) for f, v in merged for n in [np.argsort(f)]]
        frequencies, found_levels = zip(*net, strict=True)
        return np.concatenate(frequencies), np.concatenate(found_levels)

    def _levels(self, sector: str, frequency: Any) -> Any:
        exact = self.at_real(sector, 2 * np.pi * frequency)
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
