"""What is read from a bar with layers or ends, on fields made up so that the answer is known."""

from __future__ import annotations

import re

import numpy as np
import pytest
from madeup import (
    LONGITUDINAL,
    LOSSY,
    PLACES,
    SOFT,
    SPEED,
    STIFF,
    T,
    chain,
    field_of,
    plain_field,
    pulsed,
    reading_of,
)

from wavesim.grid.bar import layered_bar
from wavesim.layered.eigenfrequencies import resonances
from wavesim.planewave.dispersion_relation import long_wave_speed, wavenumber
from wavesim.readings.bar import bloch as cells_module
from wavesim.readings.bar import transmission as twowaves
from wavesim.readings.bar.bloch import cells, repeated, repeated_stretch
from wavesim.readings.bar.eigenfrequencies import audible, ringing
from wavesim.readings.bar.transmission import scattered, specimen
from wavesim.readings.pulse.spectral_windows import Exponential, Gate
from wavesim.sources import InitialField, Ricker, unfolded
from wavesim.verdict.bar import judge_bar
from wavesim.verdict.bar_answers import bar_notes


def transforming(monkeypatch, module, made):
    """Let the transform at ω + iσ of the node at x be made(ω + iσ, x), shape (n, nodes)."""

    def damped_transform(values, t, omega, sigma):
        return made(np.asarray(omega) + 1j * sigma, np.asarray(values)[0])

    monkeypatch.setattr(module, "damped_transform", damped_transform)


# Two waves in a buffer


@pytest.mark.parametrize("decay", [0.0, 80.0], ids=["travelling", "decaying"])
def test_amplitudes_of_two_waves(decay, rng):
    """a e^{ikx} + b e^{−ikx} gives a and b back to rounding; where the waves decay over the stretch
    to e^{−4.8} the smaller of the two to rounding of the larger."""
    x = np.linspace(-0.06, -0.002, 300)
    k = rng.uniform(300, 4000, 12) + 1j * rng.uniform(0, 1, 12) * decay
    a, b = rng.standard_normal((2, 12)) + 1j * rng.standard_normal((2, 12))
    U = a[:, None] * np.exp(1j * k[:, None] * x) + b[:, None] * np.exp(-1j * k[:, None] * x)
    found = twowaves.amplitudes(U, x, k)
    grown = np.exp(2 * 0.06 * k.imag)
    assert (np.abs(found[0] - a) <= 1e-11 * np.abs(a) + 1e-13 * np.abs(b)).all()
    assert (np.abs(found[1] - b) <= 1e-11 * np.abs(b) + 1e-13 * grown * np.abs(a)).all()


SPECIMEN = chain((0.03, STIFF), (0.004, SOFT), (0.002, LOSSY), (0.03, STIFF))


def buffered(layers):
    return layered_bar(layers, 1.25e-4, 8, "absorbing", "absorbing", 8e-3)


def two_waves(layers, T_made, R_made):
    """The transform of a field with these T and R at the faces of the specimen."""
    front, back = layers.layers[0], layers.layers[-1]

    def made(s, x):
        found = np.empty((len(s), len(x)), complex)
        for row, w in enumerate(s):
            k, kb = (wavenumber(m.medium, "longitudinal", np.array([w]))[0] for m in (front, back))
            before = np.exp(1j * k * (x - front.end)) + R_made * np.exp(-1j * k * (x - front.end))
            found[row] = 3e-7 * np.where(
                x <= front.end, before, T_made * np.exp(1j * kb * (x - back.start))
            )
        return found

    return made


def test_transmission_of_a_made_up_field(monkeypatch):
    """T and R are those of the field, to rounding: not those of the exact solver."""
    T_made, R_made = 0.37 - 0.2j, -0.11 + 0.6j
    transforming(monkeypatch, twowaves, two_waves(SPECIMEN, T_made, R_made))
    field = field_of(SPECIMEN, buffered(SPECIMEN), [Ricker("phi1", 0.012, 3e5)])
    found = scattered(field, LONGITUDINAL, specimen(field, LONGITUDINAL, 40, 18.0))
    assert found.judged.sum() >= 15
    assert np.abs(found.T - T_made)[found.judged].max() <= 1e-10
    assert np.abs(found.R - R_made)[found.judged].max() <= 1e-10
    assert np.abs(found.T_exact - T_made)[found.judged].min() > 1e-3
    assert found.sigma == 18.0 / T[-1]


def test_transmission_through_a_single_face(monkeypatch):
    """Two layers: φ is continuous at their face, so that 1 + R = T there; 1e-5 by the slivers that
    stand for half-spaces in the exact solver, of 1e-6 of a layer."""
    layers = chain((0.03, STIFF), (0.03, SOFT))
    transforming(monkeypatch, twowaves, two_waves(layers, 0.5, 0.5))
    field = field_of(layers, buffered(layers), [Ricker("phi1", 0.012, 1e5)])
    found = scattered(field, LONGITUDINAL, specimen(field, LONGITUDINAL, 40, 18.0))
    assert found.judged.any()
    judged = found.judged
    assert np.abs(1 + found.R_exact - found.T_exact)[judged].max() <= 1e-5
    assert np.abs(found.R_exact)[judged].min() > 0.01


def test_no_transmission_at_frequencies_that_frames_fold_something_onto(monkeypatch):
    """And the reason is told, with frames that leave none."""
    transforming(monkeypatch, twowaves, two_waves(SPECIMEN, 0.5, 0.5))
    source, bar = Ricker("phi1", 0.012, 3e5), buffered(SPECIMEN)

    def told(frames):
        field = field_of(SPECIMEN, bar, [source], {"1": 0.02}, t=np.linspace(0, 1e-4, frames))
        found = scattered(field, LONGITUDINAL, specimen(field, LONGITUDINAL, 40, 18.0))
        reading = reading_of(scattered=(found,), exact={"1": {}})
        notes = [note for note in bar_notes(reading, field) if "fold" in note]
        folded = ~unfolded([source], found.omega, field.interval)
        assert not (found.judged & folded).any()
        return found.judged.sum(), notes

    few, (note,) = told(160)
    enough, none = told(int(re.search(r"samples = (\d+)", note)[1]))
    assert 0 < few < enough
    assert none == []


@pytest.mark.parametrize(
    ("layers", "ends", "position"),
    [
        (SPECIMEN, ("absorbing", "free"), 0.012),
        (chain((0.06, STIFF)), ("absorbing", "absorbing"), 0.012),
        (SPECIMEN, ("absorbing", "absorbing"), 0.032),  # a source in the specimen
        (SPECIMEN, ("absorbing", "absorbing"), 0.0295),  # no room between source and face
        (SPECIMEN, ("absorbing", "absorbing"), 0.004),  # a source in the absorber
    ],
    ids=["an echo", "nothing between", "inside", "no room", "in the absorber"],
)
def test_no_transmission_where_there_are_no_two_buffers(layers, ends, position):
    bar = layered_bar(layers, 1.25e-4, 8, *ends, 8e-3)
    field = field_of(layers, bar, [Ricker("phi1", position, 3e5)])
    assert specimen(field, LONGITUDINAL, 10, 18.0) is None


# Cells that repeat


def test_the_longest_stretch_that_repeats():
    pair = [(2e-3, SOFT), (3e-3, STIFF)]
    start, end, cell = repeated(chain((0.01, STIFF), *pair * 4, (0.02, LOSSY)))
    # STIFF, SOFT, STIFF, …: it could begin at either; of equal lengths the first.
    assert end - start == pytest.approx(0.02, rel=1e-12)
    assert start == pytest.approx(0.01, rel=1e-12)
    assert [layer.medium for layer in cell.layers] == [SOFT, STIFF]
    assert [layer.thickness for layer in cell.layers] == pytest.approx([2e-3, 3e-3])
    triple = [(2e-3, SOFT), (2e-3, STIFF), (2e-3, LOSSY)]
    start, end, cell = repeated(chain((0.01, STIFF), *triple * 5, (2e-3, SOFT)))
    assert (start, end) == pytest.approx((0.01, 0.04))
    assert len(cell.layers) == 3
    # Three times is too few, and a cell of another thickness is no repeat.
    assert repeated(chain((0.01, STIFF), *pair * 3, (0.02, LOSSY))) is None
    other = [*pair * 2, (2.1e-3, SOFT), (3e-3, STIFF), *pair]
    assert repeated(chain((0.01, STIFF), *other, (0.02, LOSSY))) is None
    assert repeated(chain((0.01, STIFF))) is None


PAIRS = [(2.5e-3, SOFT), (2.5e-3, STIFF)] * 5


@pytest.mark.parametrize(
    ("layers", "ends"),
    [
        (chain((0.03, LOSSY), *PAIRS, (0.03, LOSSY)), ("absorbing", "absorbing")),
        (chain((0.03, LOSSY), *PAIRS), ("free", "free")),
        # A ring has no node at its right end, where this stack ends.
        (chain((0.03, LOSSY), *PAIRS), ("periodic", "periodic")),
    ],
    ids=["between buffers", "to a free end", "to the joint of a ring"],
)
def test_bloch_wave_of_a_made_up_field(layers, ends, monkeypatch):
    """u = Σ± A± p±(x) e^{±iqx} with p of period L, q made up: cos(qL) comes back to 1e-10 whatever
    the amplitudes, in pass and in stop bands, and q by its size, 0 ≤ Re qL ≤ π, Im q ≥ 0."""
    period = 5e-3
    bar = layered_bar(layers, 1.25e-4, 8, *ends, 8e-3 if "absorbing" in ends else 0)
    phase = {}

    def made(s, x):
        qL = np.linspace(0.1, 6.0, len(s)) + 1j * np.where(np.arange(len(s)) % 3, 0.02, 0.8)
        phase["qL"] = qL
        turn = 2 * np.pi * x / period
        ahead = (1 + 0.4 * np.cos(turn + 0.3)) * np.exp(1j * np.outer(qL, x - 0.03) / period)
        back = (0.7 - 0.2 * np.sin(2 * turn)) * np.exp(-1j * np.outer(qL, x - 0.055) / period)
        return ahead + 0.6j * back

    transforming(monkeypatch, cells_module, made)
    field = field_of(layers, bar, [Ricker("phi1", 0.012, 2e5)])
    stretch = repeated_stretch(field, LONGITUDINAL, 30, 18.0)
    found = cells(field, LONGITUDINAL, stretch)
    assert found.period == pytest.approx(period, rel=1e-12)
    assert found.judged.sum() >= 10
    np.testing.assert_allclose(found.cosine, np.cos(phase["qL"]), atol=1e-10)
    q = found.q * period
    assert (q.imag >= 0).all()
    assert ((q.real >= 0) & (q.real <= np.pi)).all()
    # Of ±q that which decays, with |Re q|: its conjugate where the phase runs backward.
    off = [np.abs(np.cos(w) - np.cos(phase["qL"])) for w in (q, np.conj(q))]
    assert np.minimum(*off).max() <= 1e-10
    # The exact solver's is another.
    assert np.abs(found.cosine - found.cosine_exact).max() > 0.1


def test_no_bloch_wave_with_a_source_in_the_stack():
    layers = chain((0.03, LOSSY), *PAIRS, (0.03, LOSSY))
    field = field_of(layers, buffered(layers), [Ricker("phi1", 0.04, 2e5)])
    assert repeated_stretch(field, LONGITUDINAL, 10, 18.0) is None


# Ringing


def rung(shift, lost=(), t=None):
    """A bar's exact eigenfrequencies, and a reading of sinusoids at them times 1 + shift."""
    layers = chain((0.01, SOFT), (0.006, STIFF))
    bar = layered_bar(layers, 6.25e-5, 8, "free", "fixed")
    t = np.linspace(0, 2e-3, 6001) if t is None else t
    source = Ricker("phi1", 0.004, 1e5)
    width = 2 * np.pi / float(t[-1])
    exact = resonances(layers, "free", "fixed", "longitudinal", (3e4, 1.8e6), spacing=8 * width)
    made = np.zeros((len(t), len(bar.nodes)))
    generator = np.random.default_rng(3)
    for number, omega in enumerate(exact):
        size, phase = generator.uniform(0.1, 1), generator.uniform(0, 2 * np.pi)
        if number not in lost:
            made += (size * np.cos(omega * (1 + shift) * t + phase))[:, None]
    field = field_of(layers, bar, [source], {"a": 0.003, "b": 0.011}, made, t)
    return ringing(field, LONGITUDINAL, audible(field, LONGITUDINAL)), exact


def test_eigenfrequencies_of_made_up_ringing():
    """Peaks of sinusoids through a Blackman-Harris window, padded eightfold, by a parabola through
    log power: off by less than 1e-3 bins where neighbours are 8 bins away. A shift of 1e-4 of ω
    is read as that."""
    found, exact = rung(0.0)
    assert len(found.exact) >= 3
    assert set(found.exact) <= set(exact)
    assert np.abs(found.found - found.exact).max() <= 1e-3 * found.bin
    assert found.bin == pytest.approx(2 * np.pi / 2e-3, rel=0.2)
    moved, _ = rung(1e-4)
    shift = moved.found / moved.exact - 1
    np.testing.assert_allclose(shift, 1e-4, atol=float(1e-3 * found.bin / found.exact[0]))


def test_a_mode_that_does_not_ring_is_not_heard():
    whole, exact = rung(0.0)
    gone = int(np.argmin(np.abs(exact - whole.exact[1])))
    found, _ = rung(0.0, lost=(gone,))
    assert np.isnan(found.found[1])
    assert np.isfinite(np.delete(found.found, 1)).all()
    assert not judge_bar(plain_field(), reading_of(ringing=(found,)))[0].passed


def test_no_ringing_where_waves_leave_or_are_lost():
    for layers, ends in (
        (chain((0.03, SOFT), (0.03, STIFF)), ("free", "absorbing")),
        (chain((0.03, SOFT), (0.03, LOSSY)), ("free", "free")),
    ):
        bar = layered_bar(layers, 1.25e-4, 8, *ends, 8e-3 if "absorbing" in ends else 0)
        field = field_of(layers, bar, [Ricker("phi1", 0.012, 1e5)], {"a": 0.02})
        assert audible(field, LONGITUDINAL) is None
    layers = chain((0.03, SOFT), (0.03, STIFF))
    bar = layered_bar(layers, 1.25e-4)
    assert audible(field_of(layers, bar, [Ricker("phi1", 0.012, 1e5)]), LONGITUDINAL) is None


# Pulse tests


def test_an_absorbing_end_is_read_through_an_exponential_window():
    """One medium to the absorber: one wave passes, and its k is the medium's own at ω + iσ."""
    layers = chain((0.06, STIFF))
    _, test = pulsed(layers, "absorbing", PLACES, absorber=8e-3)
    assert test.result.window == Exponential(18.0)
    assert test.medium == STIFF
    sigma = 18.0 / T[-1]
    assert test.result.dispersion.sigma == pytest.approx(sigma, rel=1e-12)
    k = wavenumber(STIFF, "longitudinal", test.result.dispersion.omega + 1j * sigma)
    np.testing.assert_array_equal(test.k_exact, k)
    # What is measured is what was made: k = (ω + iσ)/c, 1e-3 by the grid's interpolation.
    measured = test.result.dispersion.damped
    known = np.isfinite(measured)
    assert known.sum() >= 10
    made = (test.result.dispersion.omega + 1j * sigma) / SPEED
    assert np.abs(measured / made - 1)[known].max() <= 1e-3


def test_a_reflecting_end_is_gated_before_its_echo():
    """The acoustic wave is back at the last receiver after 2L − x − x_s at the long-wave speed; by
    then the gate is closed, so that an echo from then on changes no number."""
    layers = chain((0.06, STIFF))
    field, test = pulsed(layers, "free", PLACES)
    echo = (2 * field.bar.length - 0.018 - 0.004) / long_wave_speed(STIFF, "longitudinal")
    echo += max(field.sources[0].onset, 0.0)
    window = test.result.window
    assert isinstance(window, Gate)
    assert window.end == pytest.approx(max(echo, 2 * field.sources[0].peak_time), rel=1e-9)
    assert window.start < 0
    if test.k_exact is not None:  # through a gate k is judged at real ω
        known = wavenumber(STIFF, "longitudinal", test.result.dispersion.omega + 0j)
        np.testing.assert_array_equal(test.k_exact, known)
    onset = field.sources[0].onset
    later = window.end - onset - (0.010 - 0.004) / SPEED + 2e-7
    _, echoed = pulsed(layers, "free", PLACES, echo=later)
    size = np.abs(test.result.spectra.values).max()
    assert np.abs(echoed.result.spectra.values - test.result.spectra.values).max() <= 1e-6 * size
    # It could fail: an echo within the gate does.
    _, early = pulsed(layers, "free", PLACES, echo=0.3 * window.end)
    assert np.abs(early.result.spectra.values - test.result.spectra.values).max() > 1e-2 * size


def test_layers_have_no_wavenumber_of_their_own():
    layers = chain((0.012, STIFF), (0.048, SOFT))
    _, test = pulsed(layers, "absorbing", PLACES, absorber=8e-3)
    assert test.medium is None
    assert test.k_exact is None
    assert test.gaps == ()
    # All in one layer that the source is not in: its medium, but waves run both ways before it.
    _, test = pulsed(layers, "absorbing", {"2": 0.014, "3": 0.018}, absorber=8e-3)
    assert test.medium == SOFT
    assert test.k_exact is None


def test_receivers_that_can_not_be_read_as_a_pulse_test():
    layers = chain((0.06, STIFF))
    for places in (
        {"1": 0.010},
        {"1": 0.002, "2": 0.010},  # one on the other side of the source
        {"1": 0.010, "2": 0.010},  # one place
        {"1": 0.010, "2": 0.058},  # one in the absorber
        {str(n): 0.01 + 1e-3 * n for n in range(21)},
    ):
        assert pulsed(layers, "absorbing", places, absorber=8e-3)[1] is None
    rest = InitialField("phi1", 0.004, 2e-4)
    assert pulsed(layers, "absorbing", PLACES, rest, absorber=8e-3)[1] is None
    kept = pulsed(layers, "absorbing", PLACES | {"left": 0.002, "again": 0.014}, absorber=8e-3)[1]
    assert list(kept.result.record.x) == [0.010, 0.014, 0.018]
