"""Figures of a run: data in, figure out. Nothing is computed here but what is drawn.

Colour maps are perceptually uniform and run from light to dark, and lines differ by style as well
as by colour, so that a figure can be read in grey.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from scipy.signal.windows import tukey

from wavesim.equations import FIELDS, ROTATIONS
from wavesim.field import Field
from wavesim.medium import Medium
from wavesim.planewave import block_oscillations, gaps, wavenumber
from wavesim.sectors import SECTORS
from wavesim.verdict import Held

STYLE: Any = {
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.linewidth": 0.6,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "legend.fontsize": 8,
    "legend.frameon": False,
    "figure.dpi": 160,
    "savefig.dpi": 160,
    "figure.constrained_layout.use": True,
}
MAP = matplotlib.colormaps["magma_r"].with_extremes(under=(1.0, 1.0, 1.0, 0.0))
FOUND = "#c8102e"
_HALO = [patheffects.withStroke(linewidth=2.2, foreground="white")]
THEORY = "#111111"
GAP: dict[str, Any] = {"facecolor": "#dfe3e7", "linewidth": 0, "zorder": -1}
_LABEL: dict[str, Any] = {"facecolor": "white", "alpha": 0.75, "linewidth": 0, "pad": 0.8}
_DECIBELS = 60.0
_LEVEL = 120.0
_PIXELS = (900, 700)
# Frames are read so many at a time that they fit into these bytes.
_AT_ONCE = 64e6
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_LOWERED = str.maketrans("123", "₁₂₃")
SYMBOLS = {
    name: ("φ" if name in ROTATIONS else "B") + name.lstrip("phiB").translate(_LOWERED)
    for name in FIELDS
}
TITLES = {
    "longitudinal": "longitudinal: φ₁, B₁₁, B₂₂ + B₃₃",
    "transverse2": "transverse: φ₂, B₂₁, B₁₂",
    "transverse3": "transverse: φ₃, B₃₁, B₁₃",
    "inplane": "in-plane shear: B₂₃, B₃₂, B₂₂ − B₃₃",
}


def decibels(amplitude: Any, reference: float) -> np.ndarray:
    """20 log₁₀ of an amplitude over a reference, cut at −300 dB."""
    return 20 * np.log10(np.maximum(np.abs(amplitude) / reference, 1e-15))


def second_axes(axes: Axes, x: tuple[float, str] | None, y: tuple[float, str] | None) -> None:
    """Put scaled axes opposite to the SI ones: (scaled units in one shown unit, label)."""
    if x is not None:
        top = axes.secondary_xaxis("top", functions=_scaling(x[0]))
        top.set_xlabel(x[1])
    if y is not None:
        right = axes.secondary_yaxis("right", functions=_scaling(y[0]))
        right.set_ylabel(y[1])


def _scaling(factor: float) -> tuple[Callable[[Any], Any], Callable[[Any], Any]]:
    return (lambda v: v * factor), (lambda v: v / factor)


def shade_gaps(axes: Axes, field: Field, sector: str, upright: bool, named: bool = True) -> None:
    """Shade a sector's gaps on an axis in kHz; upright where frequency runs along x."""
    for gap in gaps(field.medium, sector):
        if gap.upper <= gap.lower:
            continue
        low, high = gap.lower / 2e3 / np.pi, gap.upper / 2e3 / np.pi
        (axes.axvspan if upright else axes.axhspan)(low, high, **GAP)
        if not named:
            continue
        middle = (low + high) / 2
        if upright:
            axes.text(
                middle, 0.97, gap.name, rotation=90, ha="center", va="top", fontsize=7, bbox=_LABEL,
                transform=axes.get_xaxis_transform(), clip_on=True,
            )  # fmt: skip
        else:
            axes.text(
                0.985, middle, gap.name, ha="right", va="center", fontsize=7, bbox=_LABEL,
                transform=axes.get_yaxis_transform(), clip_on=True,
            )  # fmt: skip


def _thin(values: np.ndarray, pixels: tuple[int, int]) -> np.ndarray:
    """Largest value in each of so many tiles, for a picture of a large array."""
    for axis, most in enumerate(pixels):
        values = _tiles(values, axis, -(-values.shape[axis] // most))
    return values


def _tiles(values: np.ndarray, axis: int, step: int) -> np.ndarray:
    """Largest value in each tile of so many along an axis."""
    if step <= 1:
        return values
    return np.asarray(
        np.maximum.reduceat(values, np.arange(0, values.shape[axis], step), axis=axis)
    )


def _amplitude(field: Field, sector: str) -> np.ndarray:
    """Largest amplitude of a sector in each tile of the record, (times, positions)."""
    blocks = [block for block in field.blocks if block.sector == sector]
    high, wide = (-(-n // p) for n, p in zip((len(field.t), field.bar.cells), _PIXELS, strict=True))
    rows = high * max(1, int(_AT_ONCE / (32 * field.bar.cells * high)))
    found = []
    for low in range(0, len(field.t), rows):
        square: Any = 0.0
        for block in blocks:
            for values, _ in field.components(block, slice(low, low + rows)):
                values *= values
                square = square + values[:, : field.bar.cells]
        found.append(_tiles(_tiles(square, 0, high), 1, wide))
    amplitude = np.sqrt(np.concatenate(found))
    if not field.bar.uniform:
        # A picture has even columns: each shows the tile that its place lies in.
        x = field.bar.half_nodes[::wide]
        even = (np.arange(len(x)) + 0.5) * field.bar.length / len(x)
        amplitude = amplitude[:, np.clip(np.searchsorted(x, even) - 1, 0, len(x) - 1)]
    return amplitude


def spacetime(field: Field) -> Figure:
    """Amplitude of every sector over position and time, in dB below its peak."""
    sectors = [s for s in SECTORS if any(b.sector == s for b in field.blocks)]
    columns = min(2, len(sectors))
    rows = -(-len(sectors) // columns)
    figure = Figure(figsize=(3.6 * columns + 0.8, 3.1 * rows + 0.3))
    panels = np.atleast_1d(figure.subplots(rows, columns, squeeze=False)).ravel()
    medium, bar = field.medium, field.bar
    for axes in panels[len(sectors) :]:
        axes.remove()
    for axes, sector in zip(panels, sectors, strict=False):
        amplitude = _amplitude(field, sector)
        image = axes.imshow(
            decibels(amplitude, float(amplitude.max()) or 1.0),
            origin="lower",
            aspect="auto",
            extent=(0, bar.length * 1e3, 0, field.t[-1] * 1e6),
            cmap=MAP,
            vmin=-_DECIBELS,
            vmax=0,
            interpolation="nearest",
        )
        for edge in field.layers.interfaces if field.layers is not None else ():
            axes.axvline(edge * 1e3, color="#55606b", lw=0.6, ls="--")
        for source in field.sources:
            if any(source.field in b.fields for b in field.blocks if b.sector == sector):
                axes.plot(
                    source.position * 1e3, source.peak_time * 1e6, "v", ms=5, mfc="white", mec="k"
                )
        axes.set(title=TITLES[sector], xlabel="x (mm)", ylabel="t (µs)")
        second_axes(
            axes,
            (1e-3 / medium.length_scale, "x / l"),
            (1e-6 / medium.time_scale, "t / √(4πρR⁵/3Gₙᵃ)"),
        )
    figure.colorbar(
        image,
        ax=list(panels[: len(sectors)]),
        label="amplitude (dB, peak of the panel = 0)",
        shrink=0.8,
    )
    return figure


def dispersion(field: Field, held: Sequence[Held], sector: str) -> Figure:
    """2D spectrum of a sector with the theory over it and the recovered points on the theory."""
    own = [h for h in held if h.measured.block.sector == sector]
    found = own[0].measured.spectrum
    size = min(len(h.measured.spectrum.omega) for h in own)
    power = np.sum([h.measured.spectrum.power[:, :size] for h in own], axis=0)
    medium = field.medium
    figure = Figure(figsize=(5.6, 4.6))
    axes = figure.subplots()
    to_kHz = 1 / (2e3 * np.pi)
    step_k, top = found.k[1] - found.k[0], found.omega[size - 1] * to_kHz
    image = axes.imshow(
        10 * np.log10(np.maximum(_thin(power.T, (1200, 4096)) / (power.max() or 1.0), 1e-12)),
        origin="lower",
        aspect="auto",
        extent=(-step_k / 2e3, (found.k[-1] + step_k / 2) / 1e3, 0, top),
        cmap=MAP,
        vmin=-80,
        vmax=0,
        interpolation="nearest",
    )
    shade_gaps(axes, field, sector, upright=False)
    k = np.linspace(0, found.k[-1], 400)
    for h in own:
        exact = block_oscillations(medium, h.measured.block, k)
        lines = axes.plot(k / 1e3, exact * to_kHz, color=THEORY, lw=0.8, path_effects=_HALO)
        lines[0].set_label("plane-wave solver" if h is own[0] else None)
        for branch in h.branches:
            shown = branch.k > 0
            every = max(1, int(shown.sum()) // 26)
            axes.plot(
                branch.k[shown][::every] / 1e3,
                branch.omega[shown][::every] * to_kHz,
                "o",
                ms=3.6,
                mfc="white",
                mec=FOUND,
                mew=0.9,
                label="recovered" if branch is own[0].branches[0] else None,
            )
    axes.set(
        xlim=(0, found.k[-1] / 1e3),
        ylim=_extent(own, found.k[-1], medium, top),
        xlabel="k (rad/mm)",
        ylabel="ω/2π (kHz)",
    )
    second_axes(
        axes,
        (1e3 * medium.length_scale / 2 / np.pi, "k̄ = k l/2π"),
        (2e3 * np.pi * medium.time_scale, "ω̄"),
    )
    axes.set_title(TITLES[sector])
    axes.legend(loc="lower right")
    figure.colorbar(image, ax=axes, label="power (dB)")
    return figure


def _extent(own: Sequence[Held], k: float, medium: Medium, top: float) -> tuple[float, float]:
    """Frequencies (kHz) between which a dispersion figure is drawn: all branches, with room."""
    ends = [block_oscillations(medium, h.measured.block, [0.0, k]) for h in own]
    low, high = (edge(np.concatenate(ends, axis=1)) / (2e3 * np.pi) for edge in (np.min, np.max))
    return (0.75 * low if low < top else 0.0), min(top, 1.08 * high)


def attenuation(field: Field, held: Held) -> Figure:
    """Level over distance and frequency, and complex wavenumber, measured and exact."""
    curve, block = held.measured.attenuation, held.measured.block
    assert curve is not None
    assert held.k_exact is not None
    medium = field.medium
    figure = Figure(figsize=(6.2, 7.2))
    level, loss, real = figure.subplots(3, 1, sharex=True, height_ratios=(1.2, 1, 1))
    frequency = curve.omega / (2e3 * np.pi)
    shown = _thin(curve.level.T, (600, 4096))
    image = level.imshow(
        np.maximum(shown, -_LEVEL),
        origin="lower",
        aspect="auto",
        cmap=MAP,
        vmin=-_LEVEL,
        vmax=0,
        extent=(
            frequency[0], frequency[-1], curve.distance[0] * 1e3, curve.distance[-1] * 1e3
        ),
    )  # fmt: skip
    level.set_ylabel("distance from source (mm)")
    figure.colorbar(image, ax=level, label="level (dB)")
    w = np.linspace(curve.omega[0], curve.omega[-1], 2000)
    damped = wavenumber(medium, block.sector, w + 1j * curve.sigma)
    plain = wavenumber(medium, block.sector, w)
    to_decibels = 20 / np.log(10) * 1e-3
    parts: tuple[tuple[Axes, Callable[[Any], Any], str], ...] = (
        (loss, lambda k: np.imag(k) * to_decibels, "attenuation (dB/mm)"),
        (real, lambda k: np.real(k) * 1e-3, "Re k (rad/mm)"),
    )
    for axes, part, label in parts:
        shade_gaps(axes, field, block.sector, upright=True)
        axes.plot(w / (2e3 * np.pi), part(plain), ":", color=THEORY, lw=0.9, label="exact, real ω")
        axes.plot(w / (2e3 * np.pi), part(damped), "-", color=THEORY, lw=1.0, label="exact, ω + iσ")
        axes.plot(
            frequency, part(curve.k), "o", ms=3.2, mfc="white", mec=FOUND, mew=0.8,
            label="measured, ω + iσ",
        )  # fmt: skip
        axes.set_ylabel(label)
        top = np.nanmax(part(held.k_exact))
        axes.set_ylim(-0.04 * top, 1.25 * top)
    real.set_xlabel("ω/2π (kHz)")
    loss.legend(loc="upper right")
    second_axes(level, (2e3 * np.pi * medium.time_scale, "ω̄"), None)
    second_axes(loss, None, (1e3 * np.log(10) / 20 * medium.length_scale, "Im k l"))
    second_axes(real, None, (1e3 * medium.length_scale / 2 / np.pi, "Re k l/2π"))
    level.set_title(TITLES[block.sector] + f",  σ = {curve.sigma:.3g} rad/s")
    return figure


def _power_of_ten(values: Any) -> tuple[float, str]:
    """Factor that brings values to the order of one, and what it puts before their unit."""
    largest = float(np.max(np.abs(values), initial=0.0))
    power = int(np.floor(np.log10(largest))) if largest > 0 else 0
    return 10.0**-power, f"10{str(power).translate(_RAISED)} " if power else ""


def _end_taper(count: int) -> np.ndarray:
    """1 over the record but for its last fifth, where it falls to 0 as a cosine.

    It leaves early arrivals as they are, so that spectra at different distances compare.
    """
    return np.asarray(tukey(2 * count, 0.2)[count:])


def receivers(field: Field) -> Figure:
    """Rotations (or, without any, the first field) at every receiver, and their spectra.

    The last fifth of the record is tapered for the spectra.
    """
    names = [n for n in field.names if n in ROTATIONS] or list(field.names[:1])
    figure = Figure(figsize=(7.4, 0.6 + 2.4 * len(names)))
    rows = figure.subplots(len(names), 2, squeeze=False)
    shades = matplotlib.colormaps["viridis"](np.linspace(0, 0.85, len(field.receivers)))
    styles = ["-", "--", "-.", ":"]
    for (signal, spectrum), name in zip(rows, names, strict=True):
        largest = 0.0
        signals = [field.at(position, name) for position in field.receivers.values()]
        factor, exponent = _power_of_ten(signals)
        labels = [f"{label}, {x * 1e3:g} mm" for label, x in field.receivers.items()]
        for number, (label, u) in enumerate(zip(labels, signals, strict=True)):
            kind = {"color": shades[number], "ls": styles[number % 4], "lw": 0.9}
            signal.plot(field.t * 1e6, u * factor, label=label, **kind)
            f = np.fft.rfftfreq(4 * len(u), field.interval) / 1e3
            power = np.abs(np.fft.rfft(u * _end_taper(len(u)), 4 * len(u))) * field.interval * 1e6
            largest = max(largest, float(power.max()))
            spectrum.plot(f, power, **kind)
        highest = field.band / (2e3 * np.pi)
        spectrum.set(xlim=(0, highest), ylim=(1e-5 * (largest or 1), 2 * (largest or 1)))
        spectrum.set_yscale("log")
        one_medium = field.layers is None or len(field.layers.layers) == 1
        for sector in dict.fromkeys(b.sector for b in field.blocks if name in b.fields):
            if one_medium:
                shade_gaps(spectrum, field, sector, upright=True)
        signal.set(
            ylabel=f"{SYMBOLS[name]} ({exponent}{field.unit(name)})", xlim=(0, field.t[-1] * 1e6)
        )
        spectrum.set_ylabel(f"|∫ {SYMBOLS[name]} e$^{{iωt}}$ dt| ({field.unit(name)} µs)")
    handles, labels = rows[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=max(1, min(5, len(labels))))
    rows[-1, 0].set_xlabel("t (µs)")
    rows[-1, 1].set_xlabel("ω/2π (kHz)")
    second_axes(rows[0, 0], (1e-6 / field.medium.time_scale, "t / √(4πρR⁵/3Gₙᵃ)"), None)
    second_axes(rows[0, 1], (2e3 * np.pi * field.medium.time_scale, "ω̄"), None)
    return figure


def energy(field: Field) -> Figure:
    """Kinetic and potential energy, the work of the sources, and what is lost."""
    assert field.energy is not None
    figure = Figure(figsize=(5.2, 3.2))
    axes = figure.subplots()
    factor, exponent = _power_of_ten(field.energy.total)
    dissipated = field.energy.dissipated is not None
    for name, style, colour, width in (
        *([("dissipated", "-.", "#2f6f9f", 0.9)] if dissipated else []),
        ("potential", "-", "#b9c4cf", 0.6),
        ("kinetic", "--", "#5f7183", 0.6),
        ("total", "-", THEORY, 1.2),
        ("work", ":", FOUND, 2.4),
    ):
        y = getattr(field.energy, name) * factor
        axes.plot(field.t * 1e6, y, style, color=colour, lw=width, label=name)
    axes.set(xlabel="t (µs)", ylabel=f"energy per area of the section ({exponent}J/m²)")
    second_axes(axes, (1e-6 / field.medium.time_scale, "t / √(4πρR⁵/3Gₙᵃ)"), None)
    axes.legend()
    return figure


Drawings = dict[str, Callable[[], Figure]]


def of_field(field: Field) -> Drawings:
    """Figures that show a field alone, by name, not drawn yet."""
    drawings: Drawings = {"spacetime": lambda: spacetime(field)}
    if field.receivers:
        drawings["receivers"] = lambda: receivers(field)
    if field.energy is not None:
        drawings["energy"] = lambda: energy(field)
    return drawings


def of_measurement(field: Field, held: Sequence[Held]) -> Drawings:
    """Figures that show what was measured of a field, beside the theory, not drawn yet."""
    drawings: Drawings = {}
    for sector in dict.fromkeys(h.measured.block.sector for h in held):
        drawings[f"dispersion_{sector}"] = lambda s=sector: dispersion(field, held, s)  # type: ignore[misc]
    for h in held:
        if h.k_exact is not None:
            name = f"attenuation_{h.measured.block.sector}"
            drawings[name] = lambda h=h: attenuation(field, h)  # type: ignore[misc]
    return drawings


def write(drawings: Drawings, folder: Path) -> list[Path]:
    """Draw figures and write them.

    Args:
        drawings: of :func:`of_field` or :func:`of_measurement`.
        folder: where to; made if need be.

    Returns:
        The files written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    with matplotlib.rc_context(STYLE):
        for name, draw in drawings.items():
            path = folder / f"{name}.png"
            # What savefig does, without its drawing every figure once more to settle the layout.
            FigureCanvasAgg(draw()).print_png(path, pil_kwargs={"compress_level": 1})
            written.append(path)
    return written
