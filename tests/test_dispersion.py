"""ω(k) read off fields of plane waves whose relation is known in closed form.

The fields are sums of standing waves at every wavenumber of the bar, on relations that have
nothing to do with the medium. What the window does to a peak is known in closed form too: the
4-term Blackman–Harris window has the transform

    W(ν) = Σ_m a_m/2 [D(ν − m) + D(ν + m)],   D(ν) = sin(πν)/πν

about its middle, with ν in bins of 2π/T, so that how far a parabola through three points of
log |W|² is off, and how far one peak pulls its neighbour, can be computed without any Fourier
transform.
"""

import numpy as np
import pytest
from madeup import made_field

from wavesim.grid.bar import Bar
from wavesim.material.granular_equations import ROTATION
from wavesim.material.medium import Medium
from wavesim.material.scaling import scales
from wavesim.readings.dispersion import spectrum as dispersion
from wavesim.readings.dispersion.spectrum import LOBE_BINS, peaks, ridges, spectrum
from wavesim.sources import Ricker

BLOCK = ROTATION.blocks[0]
BAR = Bar(128, 1.25e-4, 8)
DURATION, FRAMES = 6e-5, 601
# The record begins when the source has ended; what is analysed is all but the first frame or so.
SOURCE = Ricker("phi1", 0.0, 1e8, delay=-1e-6)
BIN = 2 * np.pi / (DURATION * FRAMES / (FRAMES - 1))
WINDOW = (0.35875, 0.48829, 0.14128, 0.01168)


def lobe(nu):
    """W(ν) of the Blackman–Harris window, 1 at its top."""
    terms = [a / 2 * (np.sinc(nu - m) + np.sinc(nu + m)) for m, a in enumerate(WINDOW)]
    return np.sum(terms, axis=0) / WINDOW[0]


def parabola_bias(distance=None, ratio=1.0):
    """Largest error of the log-parabola, in bins, over all offsets of the peak from the grid of
    eighths and, with a neighbour at a distance in bins, over all relative phases."""
    offset = np.linspace(-0.5, 0.5, 81)[:, None] / 8
    around = np.array([-2, -1, 0, 1, 2])[:, None, None] / 8 + offset
    phases = np.exp(2j * np.pi * np.linspace(0, 1, 48, endpoint=False)) if distance else [0.0]
    second = ratio * lobe(around - distance) if distance else 0.0 * around
    level = np.log(np.abs(lobe(around) + second * np.asarray(phases)) ** 2)
    top = np.clip(np.argmax(level, axis=0), 1, 3)
    left, middle, right = (np.take_along_axis(level, top[None] + d, axis=0)[0] for d in (-1, 0, 1))
    shift = 0.5 * (left - right) / (left - 2 * middle + right)
    found = (top - 2 + shift) / 8 + offset
    return np.abs(found).max()


def field_of(*relations, amplitudes=None, noise=0.0, rng=None, name="phi1"):
    """Standing waves cos(kx + α) cos(ωt + β) at each wavenumber, one term for each relation.

    A relation gives ω (rad/s) for wavenumbers of the bar; NaN leaves a wave out.
    """
    rng = rng or np.random.default_rng(7)
    t = np.linspace(0, DURATION, FRAMES)
    k = BAR.wavenumbers[1:]
    x = BAR.nodes if name == "phi1" else BAR.half_nodes
    values = np.zeros((FRAMES, BAR.cells))
    for relation, amplitude in zip(relations, amplitudes or [1.0] * len(relations), strict=True):
        omega = relation(k)
        present = np.isfinite(omega)
        phase_x, phase_t = rng.uniform(0, 2 * np.pi, (2, len(k)))
        in_time = np.cos(np.multiply.outer(t, np.where(present, omega, 0)) + phase_t)
        in_space = np.cos(np.multiply.outer(k, x) + phase_x[:, None])
        values += (amplitude * present * in_time) @ in_space
    values += noise * rng.normal(size=values.shape)
    fields = {f: np.zeros_like(values) for f in BLOCK.fields}
    fields[name] = values * scales(Medium()).unit(name)
    return made_field(t, fields, Medium(), BAR, (SOURCE,))


def optical(k):
    """Rises gently: 100 to 107 bins."""
    return BIN * np.sqrt(100.3**2 + (38.7 * k / BAR.wavenumbers[-1]) ** 2)


def falling(k):
    """Falls from 61 bins to 45, as no branch of the medium does."""
    return BIN * (53.13 + 8.0 * np.cos(np.pi * k / BAR.wavenumbers[-1]))


def errors(ridge, relation):
    """|Δω| in bins."""
    return np.abs(ridge.omega - relation(ridge.k)) / BIN


def test_spectrum_is_exact_in_space_and_scaled():
    """One wavenumber alone: nothing at the others, to rounding (1e-24 of the power); the axes are
    the bar's wavenumbers and an eighth of a bin, and 1 is the strongest entry."""
    alone = BAR.wavenumbers[9]
    field = field_of(lambda k: np.where(np.isclose(k, alone), 50.4 * BIN, np.nan))
    found = spectrum(field, BLOCK, BAR.wavenumbers[40])
    np.testing.assert_allclose(found.k, 2 * np.pi * np.arange(41) / 0.016, rtol=1e-14)
    assert found.bin == pytest.approx(BIN, rel=1e-12)
    assert found.omega[1] <= BIN / 8
    assert found.power.max() == 1
    others = np.arange(41) != 9
    assert found.power[others].max() < 1e-24
    omega, power = peaks(found, 9)
    assert len(omega) == 1
    assert power[0] == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize("decay", [6.0, 15.0, 28.0])
def test_a_wave_that_decays_within_the_record_is_one_wave(decay):
    """Of e^{−γt} cos ω₁t, γT = 6 to 28, and one of a hundredth of its size and 0.6 γ the window
    leaves a jump where the record begins, whose spectrum has ripples of its own (three peaks from
    γT = 15 on): two peaks, and no other, each within 0.05 bins."""
    k, waves = BAR.wavenumbers[9], (100.3 * BIN, 40.2 * BIN)
    t = np.linspace(0, DURATION, FRAMES)
    fall = (decay / DURATION, 0.6 * decay / DURATION)
    in_time = sum(
        a * np.exp(-g * t) * np.cos(w * t + 0.4)
        for a, g, w in zip((1.0, 1e-2), fall, waves, strict=True)
    )
    fields = {f: np.zeros((FRAMES, BAR.cells)) for f in BLOCK.fields}
    fields["phi1"] = np.outer(in_time, np.cos(k * BAR.nodes))
    found = spectrum(made_field(t, fields, Medium(), BAR, (SOURCE,)), BLOCK, BAR.wavenumbers[40])
    omega, _ = peaks(found, 9)
    np.testing.assert_allclose(omega, sorted(waves), atol=0.05 * BIN)


def test_spectrum_up_to_a_frequency_is_part_of_the_whole():
    field = field_of(optical, falling)
    whole, part = spectrum(field, BLOCK, 4e3), spectrum(field, BLOCK, 4e3, 90 * BIN)
    kept = len(part.omega)
    assert 90 * BIN <= part.omega[-1] <= 90 * BIN + 2 * part.omega[1]
    shown = whole.power[:, :kept]
    np.testing.assert_allclose(part.power, shown / shown.max(), rtol=1e-12)


def test_every_component_counts_in_its_own_unit():
    """The same wave in φ₁ and in B₁₁, each one scaled unit strong, has the same power."""
    for name in ("phi1", "B11"):
        found = spectrum(field_of(optical, name=name), BLOCK, BAR.wavenumbers[60])
        (ridge,) = ridges(found)
        assert errors(ridge, optical).max() < 1e-3

    def without_nyquist(k):
        return np.where(k < BAR.wavenumbers[-1], optical(k), np.nan)

    fields = field_of(without_nyquist), field_of(without_nyquist, name="B11")
    powers = [sum((p**2).sum() for p, _ in f.components(BLOCK)) for f in fields]
    assert powers[0] == pytest.approx(powers[1], rel=1e-12)


def test_too_few_wavenumbers_are_refused():
    with pytest.raises(ValueError, match=r"k_max = 500 rad/m: the bar .*; raise k_max or lengthen"):
        spectrum(field_of(optical), BLOCK, 500.0)


def test_lone_peak_is_off_by_the_bias_of_the_parabola():
    """Law: the error of a lone peak is what a parabola through log |W|² is off by, 5.9e-6 bins;
    half as much again allows for its mirror at −ω. Measured 7.0e-6 bins, |Δω|/ω of 7e-8."""
    bias = parabola_bias()
    assert 5e-6 < bias < 7e-6
    (ridge,) = ridges(spectrum(field_of(optical), BLOCK, 1e5))
    assert len(ridge.k) == 64
    assert 0.3 * bias <= errors(ridge, optical).max() <= 1.5 * bias


@pytest.mark.parametrize("distance", [4.0, 4.6, 6.0, 12.0])
def test_close_peaks_pull_each_other_as_their_lobes_overlap(distance):
    """Law: two equal waves pull each other by at most as much as the sum of two lobes allows over
    all phases; half as much again is for the mirrors at −ω. Measured 0.9 to 1.4 of the bound,
    which is 5.0e-4, 5.4e-5, 8.1e-5, 3.5e-5 bins. At LOBE_BINS = 4, from where a branch is judged,
    that is a |Δω|/ω below 2e-4 even at 4 bins from ω = 0, the lowest that is judged."""
    bias = parabola_bias(distance)
    if distance == LOBE_BINS:
        assert bias < 1e-3

    def upper(k):
        return optical(k) + distance * BIN

    low, high = ridges(spectrum(field_of(optical, upper), BLOCK, 1e5))
    for ridge, relation in ((low, optical), (high, upper)):
        assert len(ridge.k) == 64
        # The largest error over 64 random phases is also a fair part of the bound.
        assert 0.5 * bias <= errors(ridge, relation).max() <= 1.5 * bias


def test_weak_wave_beside_a_strong_one():
    """A wave of 1e-3 of the amplitude, ten bins off: pulled by side lobes of 10^(−92/20) · 1e3
    of it, 0.025, with slope π over the curvature 0.77 per bin²: 0.1 bins. Measured 4e-2."""

    def weak(k):
        return optical(k) + 10.2 * BIN

    found = ridges(spectrum(field_of(optical, weak, amplitudes=[1, 1e-3]), BLOCK, 1e5))
    assert len(found) == 2
    assert errors(found[1], weak).max() <= 0.1
    assert errors(found[0], optical).max() <= 2 * parabola_bias()


def test_crossing_branches_are_followed_through():
    """A rising and a falling line that cross: two ridges, each on its own line from end to end.
    Where they are within a lobe of each other the peaks merge; two lobes apart they are right."""

    def rising(k):
        return BIN * (40.0 + 1.6 * k / BAR.wavenumbers[1])

    def sinking(k):
        return BIN * (120.3 - 1.4 * k / BAR.wavenumbers[1])

    found = ridges(spectrum(field_of(rising, sinking), BLOCK, 1e5))
    assert len(found) == 2
    assert found[0].k[0] == found[1].k[0] == BAR.wavenumbers[1]
    assert found[0].k[-1] == found[1].k[-1] == BAR.wavenumbers[-1]
    for relation, other in ((rising, sinking), (sinking, rising)):
        ridge = min(found, key=lambda r: np.median(errors(r, relation)))
        clear = np.abs(relation(ridge.k) - other(ridge.k)) > 2 * LOBE_BINS * BIN
        assert clear.sum() > 55
        assert errors(ridge, relation)[clear].max() <= 1e-3
        assert errors(ridge, relation).max() <= LOBE_BINS


@pytest.mark.parametrize(("missing", "count"), [(1, 1), (3, 1), (4, 2), (8, 2)])
def test_branch_goes_on_over_a_missing_stretch(missing, count):
    """Up to three wavenumbers may be missing; a longer break makes two ridges. None is invented."""
    gone = BAR.wavenumbers[30 : 30 + missing]

    def broken(k):
        return np.where(np.isin(k, gone), np.nan, falling(k))

    found = ridges(spectrum(field_of(broken, optical), BLOCK, 1e5))
    lower = [r for r in found if np.median(errors(r, falling)) < 1]
    assert len(found) == count + 1
    assert len(lower) == count
    k = np.concatenate([r.k for r in lower])
    assert len(k) == 64 - missing
    assert not np.isin(k, gone).any()
    for ridge in lower:
        assert errors(ridge, falling).max() <= 1e-4


def test_short_stretch_is_no_branch():
    """Four wavenumbers are no branch, five are."""
    for length, count in ((4, 1), (5, 2)):

        def short(k, length=length):
            return np.where(np.isin(k, BAR.wavenumbers[20 : 20 + length]), falling(k), np.nan)

        assert len(ridges(spectrum(field_of(short, optical), BLOCK, 1e5))) == count


def test_noise_below_the_floor_makes_no_branch(rng):
    """White noise of 1e-4 of the amplitude: its power over that of the peak is about
    8 σ²/(N a²) · 2 = 3e-10, its largest value ten times that, below the floor of 1e-8. The
    frequency scatters by √6/π · σ/(A √N) times 1.5 for the window, 5e-6 bins rms; five
    times that and the bias are 5e-5. Measured 8e-6."""
    field = field_of(optical, falling, noise=1e-4 / 8, rng=rng)
    found = ridges(spectrum(field, BLOCK, 1e5))
    assert len(found) == 2
    assert errors(found[0], falling).max() <= 5e-5
    assert errors(found[1], optical).max() <= 5e-5


def test_nothing_has_no_ridge():
    empty = field_of(lambda k: np.full_like(k, np.nan))
    assert ridges(spectrum(empty, BLOCK, 1e5)) == []


def test_samples_with_a_source_are_left_out():
    """What the source still drives is no free wave: the analysis begins when it ends, and with the
    first frame where it acts for as long as the record lasts."""
    full = field_of(optical)
    for peak_frequency, delay in ((1e6, 4.05e-6), (1e5, None), (2e4, None)):
        source = Ricker("phi1", 0.0, peak_frequency, delay=delay)
        field = made_field(full.t, full.values, Medium(), BAR, (source,))
        quiet = int((full.t >= source.end).sum())
        frames = quiet if quiet >= 32 else FRAMES
        found = spectrum(field, BLOCK, 1e5)
        assert found.bin == pytest.approx(2 * np.pi / (frames * field.interval), rel=1e-12)


@pytest.mark.parametrize("most", [7, 20, 40])
def test_of_many_wavenumbers_an_even_part_is_taken(most, monkeypatch):
    """Law: each wavenumber's spectrum depends on no other, so every n-th row is that of the whole,
    to rounding; there are no more rows than allowed, and k = 0 is among them."""
    field = field_of(optical, falling)
    whole = spectrum(field, BLOCK, BAR.wavenumbers[40])
    monkeypatch.setattr(dispersion, "MOST_WAVENUMBERS", most)
    part = spectrum(field, BLOCK, BAR.wavenumbers[40])
    every = -(-41 // most)
    assert len(part.k) <= most
    np.testing.assert_array_equal(part.k, whole.k[::every])
    shown = whole.power[::every]
    np.testing.assert_allclose(part.power, shown / shown.max(), rtol=1e-9, atol=1e-20)


def test_record_read_in_parts_is_the_record(monkeypatch):
    """A few frames and wavenumbers at a time, or all at once: the same to rounding."""
    field = field_of(optical, falling)
    whole = spectrum(field, BLOCK, 4e3)
    monkeypatch.setattr(dispersion, "_AT_ONCE", 7 * 48 * BAR.cells)
    part = spectrum(field, BLOCK, 4e3)
    np.testing.assert_allclose(part.power, whole.power, rtol=1e-9, atol=1e-20)
