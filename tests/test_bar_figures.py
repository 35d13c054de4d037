"""Figures of real bars: what is drawn stands where it should, dense enough, and names itself."""

from __future__ import annotations

import dataclasses

import matplotlib
import numpy as np
import pytest
from madeup import (
    LONGITUDINAL,
    LOSSY,
    PLACES,
    SOFT,
    STIFF,
    cells_of,
    chain,
    field_of,
    plain_field,
    reading_of,
    scattered_of,
)
from matplotlib.backends.backend_agg import FigureCanvasAgg

from wavesim.figures import bar as barfigures
from wavesim.figures import field as fieldfigures
from wavesim.figures.bar_section import bar_section
from wavesim.figures.style import STYLE
from wavesim.grid.bar import layered_bar
from wavesim.layered.bloch import bloch
from wavesim.layered.transmission import transmission
from wavesim.material.layers import Layers
from wavesim.planewave.dispersion_relation import gaps, wavenumber
from wavesim.readings.bar.bloch import repeated_stretch
from wavesim.readings.bar.excited_band import line
from wavesim.readings.bar.transmission import exact_scattering
from wavesim.sources import Ricker
from wavesim.verdict.foreseen_errors import SIGNAL_TOLERANCE

TO_KHZ = 1 / (2e3 * np.pi)
SLAB = chain((0.02, STIFF), (0.006, SOFT), (0.02, STIFF))


def slab_field(receivers=None, layers=SLAB):
    bar = layered_bar(layers, 1.25e-4, left="absorbing", right="absorbing", absorber=4e-3)
    at = receivers or {"a": 0.015, "b": 0.03}
    return field_of(layers, bar, [Ricker("phi1", 0.008, 3e5)], at)


def laid_out(figure):
    """The figure laid out, with its labels inside it."""
    with matplotlib.rc_context(STYLE):
        figure.draw_without_rendering()
        renderer = FigureCanvasAgg(figure).get_renderer()
        frame = figure.bbox.padded(1)
        for axes in figure.axes:
            for text in (*axes.texts, axes.title, axes.xaxis.label, axes.yaxis.label):
                if text.get_text() and not text.get_clip_on():
                    box = text.get_window_extent(renderer)
                    assert frame.contains(box.x0, box.y0), text.get_text()
                    assert frame.contains(box.x1, box.y1), text.get_text()
    return figure


def drawn(function, *arguments):
    with matplotlib.rc_context(STYLE):
        return laid_out(function(*arguments))


def test_exact_line_is_finer_than_anything_on_it():
    """At ω + iσ nothing is narrower than σ: six points to σ, and never fewer than measured."""
    omega = np.linspace(1e5, 1e7, 100)
    fine = line(omega, 1.2e5)
    assert fine[0] == omega[0]
    assert fine[-1] == omega[-1]
    assert np.diff(fine).max() <= 1.2e5 / 6
    assert len(line(omega, 1e9)) == 100
    assert len(line(omega, 1.0)) == 4000


def test_line_of_transmission_is_that_of_the_exact_solver():
    """By the exact solver on the whole bar, its planes moved to the faces: to 1e-9."""
    omega = 2 * np.pi * np.linspace(2e5, 9e5, 20)
    sigma = 1e5
    fine = line(omega, sigma)
    T, R = exact_scattering(SLAB, "longitudinal", fine + 1j * sigma)
    half = np.full(20, 0.5 + 0j)
    found = scattered_of(omega, sigma, *(half,) * 4, np.ones(20, bool), (fine, T, R, T))
    figure = drawn(barfigures.transmission, slab_field(), found)
    lines = {one.get_label(): one for one in figure.axes[0].lines}
    f, level = lines["T, record (ω + iσ): exact"].get_data()
    assert len(f) > 3 * len(omega)
    s = f / TO_KHZ + 1j * sigma
    whole = transmission(SLAB, "longitudinal", s)
    k = wavenumber(STIFF, "longitudinal", s)
    there = np.exp(-1j * k * 0.02)
    np.testing.assert_allclose(10 ** (level / 20), np.abs(whole.T * there**2), rtol=1e-9)
    np.testing.assert_allclose(T, whole.T * there**2, rtol=1e-7)
    np.testing.assert_allclose(R, whole.R * there**2, rtol=1e-7)
    level = lines["R, record (ω + iσ): exact"].get_ydata()
    np.testing.assert_allclose(10 ** (level / 20), np.abs(R), rtol=1e-9)
    # Points stay where they were measured.
    assert len(lines["T, record (ω + iσ): simulated"].get_xdata()) == 20
    assert "σ/2π = 15.9 kHz" in figure.axes[1].get_xlabel()


def test_line_of_bloch_waves_is_dense():
    stack = chain((0.02, STIFF), *((0.002, SOFT), (0.002, STIFF)) * 4, (0.002, SOFT), (0.02, STIFF))
    field = slab_field(layers=stack)
    known = repeated_stretch(field, LONGITUDINAL, 20, 18.0)
    fine, q = known.line
    cell = Layers(tuple(chain((0.002, SOFT), (0.002, STIFF)).layers))
    for omega, cosine in ((known.omega, known.cosine_exact), (fine, np.cos(q * 4e-3))):
        exact = np.cos(bloch(cell, "longitudinal", omega + 1j * known.sigma) * 4e-3)
        # Folded: of ±q that which decays, |Re q| for Re q, so that cos qL may be the conjugate.
        np.testing.assert_allclose(cosine.real, exact.real, rtol=1e-9)
        np.testing.assert_allclose(np.abs(cosine.imag), np.abs(exact.imag), rtol=1e-9)
    assert (q.imag >= 0).all()
    measured = np.interp(known.omega, fine, q)
    told = known.cosine_exact, np.ones(20, bool), known.line
    found = cells_of(4e-3, known.omega, known.sigma, measured, *told)
    figure = drawn(barfigures.bloch, field, found)
    for axes, part in zip(figure.axes, (np.real, np.imag), strict=True):
        line_of, points = axes.lines
        assert len(line_of.get_xdata()) > 3 * len(known.omega)
        np.testing.assert_allclose(
            np.interp(points.get_xdata(), *line_of.get_data()), points.get_ydata(), rtol=1e-9
        )
        assert np.ptp(part(q)) > 0


def test_bar_is_lettered_by_what_it_is_of():
    figure = drawn(bar_section, slab_field(), ["longitudinal"])
    stand, made, gap = figure.axes
    assert [text.get_text() for text in made.texts] == ["A", "B", "A", "absorbing", "absorbing"]
    spans = sorted((p.get_x(), p.get_x() + p.get_width()) for p in made.patches)
    np.testing.assert_allclose(spans, [(0, 20), (20, 26), (26, 46)], rtol=1e-12)
    told, key = (
        [text.get_text() for text in legend.get_texts()] for legend in reversed(figure.legends)
    )
    assert {"source", "receiver", "band gap", "absorber", "peak frequency of a source"} == set(key)
    assert told[0].startswith("A:  ")
    assert f"G_n_a {STIFF.G_n_a:g}" in told[0]
    assert f"G_n_a {SOFT.G_n_a:g}" in told[1]
    at = sorted((one.get_marker(), float(one.get_xdata()[0])) for one in stand.lines)
    assert at == [("^", 15.0), ("^", 30.0), ("v", 8.0)]
    (line_of,) = [one for one in gap.lines if one.get_linestyle() == "--"]
    assert line_of.get_ydata()[0] == 300.0
    names = [text.get_text() for text in gap.texts]
    assert names == [g.name for g in gaps(STIFF, "longitudinal")]


def test_bar_of_one_lossy_medium_says_its_loss():
    layers = chain((0.06, LOSSY))
    field = field_of(layers, layered_bar(layers, 1.25e-4), [Ricker("phi1", 0.012, 3e5)], {})
    figure = drawn(bar_section, field, ["longitudinal"])
    texts = [t.get_text() for legend in figure.legends for t in legend.get_texts()]
    assert "receiver" not in texts
    assert "absorber" not in texts
    assert any(" Q " in text and "kHz" in text for text in texts)


def test_difference_is_what_the_verdict_judges():
    """Its highest point is the error of the verdict, over all fields; the tolerance is marked."""
    field = plain_field()
    noise = np.random.default_rng(1)
    exact = {
        name: {key: field.at(x, key) + 1e-5 * noise.standard_normal(len(field.t))
               for key in field.names}
        for name, x in PLACES.items()
    }  # fmt: skip
    worst = {
        name: max(
            np.abs(field.at(PLACES[name], key) - u).max() / np.abs(u).max()
            for key, u in own.items()
        )
        for name, own in exact.items()
    }
    figure = drawn(barfigures.signals, field, reading_of(exact=exact))
    below = figure.axes[-1]
    lines = {one.get_label(): one for one in below.lines}
    assert below.get_yscale() == "log"
    assert set(lines) == {*PLACES, "tolerance"}
    assert set(lines["tolerance"].get_ydata()) == {SIGNAL_TOLERANCE}
    for name, error in worst.items():
        assert lines[name].get_ydata().max() == pytest.approx(error, rel=1e-12)
    assert below.get_xlim() == (0, field.t[-1] * 1e6)


@pytest.mark.parametrize("count", [1, 5, 40])
def test_record_section(count):
    """Traces at their positions in mm, below each its name; the scale is said."""
    places = {f"r{n}": 0.001 * (n + 3) for n in range(count)}
    field = slab_field(places)
    t, x = field.t[:, None], field.bar.nodes[None, :]
    # A pulse at 2000 m/s, of one height.
    moving = np.exp(-(((t - x / 2000 - 2e-6) / 1e-6) ** 2))
    field = dataclasses.replace(field, values=dict(field.values) | {"phi1": 3e-7 * moving})
    figure = drawn(fieldfigures.receivers, field)
    section = figure.axes[0]
    traces = [one for one in section.lines if one.get_linestyle() == "-"]
    (marks,) = [one for one in section.lines if one.get_marker() == "|"]
    assert len(traces) == count
    assert "one scale, peak 3 × 10⁻⁷ rad" in section.get_title()
    for trace, position in zip(traces, places.values(), strict=True):
        assert trace.get_ydata()[0] == pytest.approx(position * 1e3, abs=0.05)
        top = trace.get_xdata()[np.argmax(trace.get_ydata())]
        assert top == pytest.approx((position / 2000 + 2e-6) * 1e6, abs=field.interval * 1e6)
    # 5 % of a Gaussian is √ln 20 widths before its top, to a frame.
    early = np.array(list(places.values())) / 2000 + 2e-6 - np.sqrt(np.log(20)) * 1e-6
    np.testing.assert_allclose(marks.get_xdata(), early * 1e6, atol=1.5 * field.interval * 1e6)
    assert len(figure.legends[0].get_texts()) <= 10


def test_record_section_of_unlike_and_uneven_receivers():
    """Each to its own peak where one is ten times lower; in order where two stand close."""
    places = {"far": 0.03, "one": 0.005, "two": 0.0052}
    field = slab_field(places)
    t, x = field.t[:, None], field.bar.nodes[None, :]
    size = np.where(x > 0.02, 0.1, 1.0)
    moving = size * np.exp(-(((t - x / 2000 - 2e-6) / 1e-6) ** 2))
    field = dataclasses.replace(field, values=dict(field.values) | {"phi1": moving})
    section = drawn(fieldfigures.receivers, field).axes[0]
    assert "each to its peak, 0.1 to 1 rad" in section.get_title()
    assert "in order" in section.get_ylabel()
    assert [text.get_text() for text in section.get_yticklabels()] == ["5", "5.2", "30"]
    assert [text.get_text() for text in section.texts] == ["one", "two", "far"]
    traces = [one for one in section.lines if one.get_linestyle() == "-"]
    assert all(np.ptp(one.get_ydata()) == pytest.approx(0.62, rel=0.01) for one in traces)
