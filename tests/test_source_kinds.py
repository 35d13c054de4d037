"""Sources of every kind: signal and transform, what they say of themselves, what they refuse."""

from __future__ import annotations

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from wavesim.material.granular_equations import ROTATION
from wavesim.material.layers import Layer, Layers
from wavesim.material.medium import Medium
from wavesim.planewave.dispersion_relation import block_frequencies
from wavesim.simulation.simulation import highest_band
from wavesim.sources import (
    Chirp,
    GaussianDerivative,
    InitialField,
    Recorded,
    Ricker,
    ToneBurst,
    excitation,
    excited_band,
    parameters,
    read_csv,
)

F = 6e5
TIMES = np.arange(160) * 1e-7 + 3e-7
VALUES = np.exp(-(((TIMES - 8e-6) / 1.6e-6) ** 2)) * np.sin(2 * np.pi * F * TIMES)

KINDS = [
    Ricker("phi1", 0.0, F, 3.0),
    GaussianDerivative("phi1", 0.0, F, -2.0),
    GaussianDerivative("B12", 0.0, F, delay=5e-6),
    ToneBurst("phi1", 0.0, F, amplitude=2.0),
    ToneBurst("phi1", 0.0, F, 1.0),
    ToneBurst("phi1", 0.0, F, 3.7, "cos4", start=2e-6),
    ToneBurst("phi2", 0.0, F, 12.0, "cos6", amplitude=1e-3),
    Chirp("phi1", 0.0, 1e5, 1e6, 5e-5, amplitude=4.0),
    Chirp("phi1", 0.0, 3e5, 4e5, 1e-5, taper=0.5, start=1e-6),
    Recorded("phi1", 0.0, TIMES, VALUES, amplitude=2.0),
    Recorded("phi1", 0.0, TIMES, VALUES, start=5e-6),
]
NAMES = [f"{n}-{source.kind}" for n, source in enumerate(KINDS)]
every_kind = pytest.mark.parametrize("source", KINDS, ids=NAMES)


def gauss(source, panels):
    """Gauss nodes and weights over the whole signal; panels end where a spline's pieces do."""
    edges = np.linspace(source.onset, source.end, panels + 1)
    x, w = np.polynomial.legendre.leggauss(16)
    half = np.diff(edges)[:, None] / 2
    return (edges[:-1, None] + half * (1 + x)).ravel(), (half * w).ravel()


@every_kind
@pytest.mark.parametrize("growth", [0.0, 0.4, -0.3])
def test_spectrum_is_the_fourier_integral(source, growth):
    """∫ s(t) e^{iωt} dt by composite Gauss sums over the signal, at real and complex ω, from 0 to
    four times the frequency, and close to where a term of the closed forms is 0/0. To 1e-12 of the
    largest |s e^{iωt}| times the duration, 1e-9 being asked for; measured 3e-14 at most (chirp).
    """
    pieces = 1
    if isinstance(source, Recorded):
        pieces = len(source.values) + 3
    t, weights = gauss(source, max(200 // pieces, 1) * pieces)
    bins = 1 / (source.end - source.onset)
    hertz = np.array([0.0, 1e-3, 1e4, 0.5 * F, F, F * (1 + 1e-12), F + bins, 1.3 * F, 4 * F])
    omega = 2 * np.pi * (hertz + 1j * growth * bins)
    kernel = source.signal(t) * np.exp(1j * omega[:, None] * t)
    size = np.abs(kernel).max() * (source.end - source.onset)
    error = np.abs(source.spectrum(omega) - kernel @ weights).max()
    assert error <= 1e-12 * size
    assert source.spectrum(omega.reshape(3, 3)).shape == (3, 3)
    assert complex(source.spectrum(omega[3])) == pytest.approx(complex(source.spectrum(omega)[3]))


@every_kind
def test_signal_of_numpy_and_jax_arrays_alike(source):
    """Compiled too, with derivatives. To 1e-12 of the amplitude; measured 1e-13 (phase of 300)."""
    t = np.linspace(source.onset - 1e-6, source.end + 1e-6, 303).reshape(3, 101)
    traced = jax.jit(source.signal)(jnp.asarray(t))
    assert isinstance(traced, jax.Array)
    assert traced.dtype == np.float64
    expected = source.signal(t)
    np.testing.assert_allclose(traced, expected, rtol=0, atol=1e-12 * abs(source.amplitude))
    assert source.signal(float(t[1, 50])) == pytest.approx(expected[1, 50], rel=1e-12)
    # The derivative is what differences of order 2 tend to, to h²s‴/6 < 1e-4 of ω times peak.
    h = 2e-3 / (2 * np.pi * F)
    rate = jax.vmap(jax.grad(lambda at: jnp.sum(source.signal(at))))(jnp.asarray(t.ravel()))
    slope = (source.signal(t.ravel() + h) - source.signal(t.ravel() - h)) / (2 * h)
    scale = 2 * np.pi * F * np.abs(expected).max()
    np.testing.assert_allclose(rate, slope, rtol=0, atol=1e-4 * scale)


@every_kind
def test_what_a_source_says_of_its_duration(source):
    """Below 1e-15 of its peak outside onset and end; not so just inside, within a tenth."""
    span = source.end - source.onset
    t = np.linspace(source.onset, source.end, 20001)
    peak = np.abs(source.signal(t)).max()
    outside = np.concatenate([source.onset - np.linspace(0, span), source.end + t - source.onset])
    assert np.abs(source.signal(outside)).max() < 1.1e-15 * peak
    for inside in (t < source.onset + span / 10, t > source.end - span / 10):
        assert np.abs(source.signal(t[inside])).max() > 1e-15 * peak
    assert source.onset < source.peak_time < source.end


@every_kind
def test_what_a_source_says_of_its_spectrum(source):
    """Band, excited band, largest value and where it is, against the spectrum on a finer grid.

    The grid read off by the finite kinds has 16 points to 2π/T: a band is right to one of them, the
    largest value to 1e-4 (a parabola through three points of a lobe). The Ricker pulse's band ends
    at 3.3 %, as it always has.
    """
    step = 2 * np.pi / (source.end - source.onset) / 50
    omega = np.arange(0, 9 * 2 * np.pi * F, step)
    size = np.abs(source.spectrum(omega))
    assert source.strongest == pytest.approx(size.max(), rel=5e-4)
    level = 0.034 if isinstance(source, Ricker) else 0.0301
    assert size[omega > source.band].max() < level * size.max()
    assert size[omega > source.band - 4 * step].max() > 0.0297 * size.max()
    if not isinstance(source, Chirp):
        assert 2 * np.pi * source.peak_frequency == pytest.approx(
            omega[np.argmax(size)], abs=1.01 * step
        )
    heard = omega[size >= 1.002e-3 * size.max()]
    low, high = source.excited
    assert low <= heard[0]
    assert heard[-1] <= high <= heard[-1] + 8 * step
    assert heard[0] - low <= 8 * step
    if math.isfinite(source.spectral_end):
        assert size[omega > source.spectral_end].max() < 5e-14 * size.max()
    np.testing.assert_allclose(
        excitation([source], omega[:500]), size[:500] / size.max(), rtol=0, atol=5e-4
    )


@every_kind
def test_a_source_is_hashable_and_knows_its_parameters(source):
    """Jax takes it as static; the parameters make the same source again."""
    again = type(source)(**parameters(source))
    assert hash(again) == hash(dataclasses.replace(again))
    assert parameters(again) == parameters(source)
    t = np.linspace(source.onset, source.end, 99)
    np.testing.assert_array_equal(again.signal(t), source.signal(t))


def test_excited_band_of_different_kinds():
    low, high = excited_band(KINDS[:2])
    assert (low, high) == (KINDS[1].excited[0], KINDS[1].excited[1])
    assert excitation(KINDS[:2], np.array([2 * np.pi * F])) == pytest.approx([1.0], rel=1e-12)


# Each kind by itself


def test_gaussian_derivative_is_what_it_is_called():
    """−d/dt of σ e^{½} exp(−t²/2σ²), σ = 1/ω_p, by differences of order 2: (h/σ)²/6 · 3 = 2e-8."""
    source = GaussianDerivative("phi1", 0.0, F)
    sigma = 1 / (2 * np.pi * F)
    t, h = source.peak_time + np.linspace(-5, 5, 201) * sigma, 2e-4 * sigma

    def hump(at):
        return sigma * np.exp(0.5 - ((at - source.peak_time) / sigma) ** 2 / 2)

    np.testing.assert_allclose(
        source.signal(t), (hump(t + h) - hump(t - h)) / (2 * h), rtol=0, atol=5e-8
    )
    assert source.signal(source.peak_time - sigma) == pytest.approx(1.0, rel=1e-15)


@pytest.mark.parametrize(("window", "smooth"), [("hann", 1), ("cos4", 3), ("cos6", 5)])
def test_window_starts_with_as_many_derivatives_as_it_says(window, smooth):
    """s ∝ τ^(p+1) at its start, one power of it from the sine: the slope of log s over log τ."""
    source = ToneBurst("phi1", 0.0, F, 5.0, window)
    small = source.signal(np.array([1e-4, 2e-4]) * source.duration)
    assert np.log2(small[1] / small[0]) == pytest.approx(smooth + 2, abs=1e-3)
    assert source.signal(source.duration / 2) == pytest.approx(np.sin(5 * np.pi), abs=1e-12)


def test_hann_burst_by_hand():
    """½(1 − cos 2πτ/T) sin 2πfτ at three times, and 0 outside."""
    source = ToneBurst("phi1", 0.0, 1e6, 4.0, amplitude=3.0, start=1e-6)
    for tau in (0.3e-6, 1.1e-6, 3.6e-6):
        expected = 1.5 * (1 - math.cos(math.pi * tau / 2e-6)) * math.sin(2 * math.pi * 1e6 * tau)
        assert source.signal(1e-6 + tau) == pytest.approx(expected, rel=1e-12)
    assert source.signal(np.array([0.9e-6, 5.1e-6])).tolist() == [0.0, 0.0]


def test_sweep_goes_from_low_to_high():
    """Between zeros the frequency is low + (high − low)τ/T: half-periods by interpolation, to 1e-3
    (the frequency changes by 1 part in 40 over one)."""
    source = Chirp("phi1", 0.0, 2e5, 1e6, 1e-4)
    t = np.linspace(0.11e-4, 0.89e-4, 200001)
    s = source.signal(t)
    zeros = t[:-1][s[:-1] * s[1:] < 0]
    middle, rate = (zeros[1:] + zeros[:-1]) / 2, 0.5 / np.diff(zeros)
    np.testing.assert_allclose(rate, 2e5 + 8e5 * middle / 1e-4, rtol=1e-3)
    assert np.abs(s).max() == pytest.approx(1.0, abs=1e-4)


def test_recorded_curve_goes_through_its_samples_and_is_smooth():
    """Values at the samples, to the rounding of (t − t₀)/Δ, 160 · 2e-16 · ωΔ = 1.4e-14; first and
    second derivative agree from both sides of every sample (the second to h s‴/ω² = 1e-4 of ω² s);
    zero outside."""
    source = Recorded("phi1", 0.0, TIMES, VALUES)
    np.testing.assert_allclose(source.signal(TIMES), VALUES, rtol=0, atol=1.4e-14)
    omega, h = 2 * np.pi * F, 3e-5 / (2 * np.pi * F)
    joints = source.first + source.interval * np.arange(-2, len(TIMES) + 2)
    first = jax.vmap(jax.grad(source.signal))
    second = jax.vmap(jax.grad(jax.grad(source.signal)))
    for derivative, scale in ((first, omega), (second, omega**2)):
        after, before = derivative(jnp.asarray(joints + h)), derivative(jnp.asarray(joints - h))
        assert np.abs(after - before).max() < 2e-4 * scale
    # The samples of a band-limited signal: between them the curve is off by (ωΔ)⁴/720 (2.8e-5
    # here), and by the signal's bandwidth of a third not more than four times that.
    t = np.linspace(TIMES[20], TIMES[-20], 3001)
    exact = np.exp(-(((t - 8e-6) / 1.6e-6) ** 2)) * np.sin(2 * np.pi * F * t)
    assert np.abs(source.signal(t) - exact).max() < 4 * (omega * 1e-7) ** 4 / 720


def test_initial_field():
    """Its transform is that of a kick, and its band in a medium that of the waves it holds."""
    source = InitialField("phi1", 0.01, 1e-3, 2e-4)
    assert source.drive == "initial"
    assert (source.end, source.peak_time, source.signal(np.ones(3)).tolist()) == (0, 0, [0.0] * 3)
    omega = np.array([3.0 + 1j])
    assert source.spectrum(omega)[0] == -1j * 2e-4 * (3 + 1j)
    k = np.array([0.0, 1e3, 2e3])
    np.testing.assert_allclose(
        excitation([source], np.full(3, 1e6), k), np.exp(-(k**2) * 1e-6 / 2), rtol=1e-15
    )
    soft, medium = Medium(G_n_a=2.0), Medium(anisotropy=0.3)
    layers = Layers((Layer(0.0, 0.01, soft), Layer(0.01, 0.02, medium)))  # the stiffer one decides
    edge = math.sqrt(2 * math.log(1 / 0.03)) / 1e-3
    assert math.exp(-((edge * 1e-3) ** 2) / 2) == pytest.approx(0.03, rel=1e-12)
    highest = max(
        block_frequencies(medium, block, [edge]).max() for block in ROTATION.excited(["phi1"])
    )
    assert highest_band([source], layers) == highest
    assert highest_band([source, Ricker("phi1", 0.0, 1e9)], layers) == Ricker("phi1", 0.0, 1e9).band


PLACE = {"field": "phi1", "position": 0.0}
BURST = (ToneBurst, PLACE | {"frequency": F})
SWEEP = (Chirp, PLACE | {"low": 1e5, "high": 1e6, "duration": 1e-4})
RECORD = (Recorded, PLACE | {"times": TIMES, "values": VALUES})
PULSE = (Ricker, PLACE | {"peak_frequency": F})


@pytest.mark.parametrize(
    ("made", "arguments", "message"),
    [
        (BURST, {"frequency": 0.0}, "frequency = 0 Hz: must be > 0"),
        (BURST, {"cycles": 0.5}, "cycles = 0.5: must be 1 or greater"),
        (BURST, {"window": "rect"}, "window = 'rect': must be one of hann, cos4, cos6"),
        (BURST, {"start": -1e-6}, "start = -1e-06 s: must be 0 or greater"),
        (BURST, {"field": "phi4"}, "field = 'phi4': must be one of"),
        (SWEEP, {"low": 2e6}, r"low = 2e\+06 Hz: must be below high"),
        (SWEEP, {"duration": 1e-6}, "duration = 1e-06 s: .* take 1e-05 s or more"),
        (SWEEP, {"taper": 0.6}, "taper = 0.6: must be between 0.01 and 0.5"),
        (RECORD, {"values": VALUES[1:]}, "times: 160 given for 159 values"),
        (RECORD, {"values": 0 * VALUES}, "all are 0"),
        (RECORD, {"values": VALUES + 0.02}, "sample 1: value = 0.02: .* take off its mean"),
        (PULSE, {"drive": "push"}, "drive = 'push': must be one of body, moment, rotation"),
        (PULSE, {"drive": "moment", "width": 1e-3}, "width = 0.001 m: must be 0 for drive"),
        (PULSE, {"drive": "rotation", "field": "B11"}, "field = .B11.: .* one of phi1, phi2, phi3"),
    ],
)
def test_a_source_that_can_not_be(made, arguments, message):
    kind, given = made
    with pytest.raises(ValueError, match=message):
        kind(**(given | arguments))


# Files


def written(tmp_path, *rows, name="signal.csv"):
    path = tmp_path / name
    path.write_text("\n".join(rows) + "\n")
    return path


ROWS = [f"{t!r},{v!r}" for t, v in zip(TIMES.tolist(), VALUES.tolist(), strict=True)]


def test_file_of_two_columns(tmp_path):
    """Commas, semicolons or blanks; a heading, comments and empty lines are skipped."""
    for rows in (
        ROWS,
        ["time (s),moment", *ROWS],
        ["# made by hand", "", "t;v", *(row.replace(",", ";") for row in ROWS)],
        [row.replace(",", "\t") for row in ROWS],
        ["\ufefft,v", *ROWS],
    ):
        times, values = read_csv(written(tmp_path, *rows))
        assert times == TIMES.tolist()
        assert values == VALUES.tolist()


def test_times_may_be_rounded_as_files_round_them(tmp_path):
    """To 5e-12 of 1.6e-5 s: even to 1e-6 of the record, though not to 1e-6 of a sample."""
    rows = [f"{1.0003 * t:.11f},{v}" for t, v in zip(TIMES, VALUES, strict=True)]
    assert len(read_csv(written(tmp_path, *rows))[0]) == 160


def altered(at, row):
    return [*ROWS[:at], row, *ROWS[at + 1 :]]


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (altered(9, "1.2e-06,nan"), "line 10: value = nan: must be finite; fill it in"),
        (altered(9, "nan,0.0"), "line 10: t = nan: must be finite"),
        (altered(9, "1.2e-06,"), "line 10: '1.2e-06,': must be two numbers"),
        (altered(9, "1.2e-06"), "line 10: '1.2e-06': must be two numbers"),
        (altered(9, "1.2e-06,0,0"), "line 10: '1.2e-06,0,0': must be two numbers"),
        (altered(0, "3e-07,x"), "line 1: '3e-07,x': must be two numbers"),
        (altered(9, "2e-07,0.0"), "line 10: t = 2e-07: must be after t = 1.1e-06; sort"),
        (altered(9, ROWS[8]), "line 10: t = 1.1e-06: must be after"),
        (ROWS[:30] + ROWS[31:], "line 31: t = 3.4e-06: a gap of 2e-07 s, where samples are 1e-07"),
        (altered(9, "1.22e-06,0.0"), "line 10: t = 1.22e-06: samples must be even in time"),
        (ROWS[:5], "5 samples: at least 8 are needed"),
        ([], "0 samples: at least 8 are needed"),
        (ROWS[:60], "line 60: value = .*: the record must begin and end within 0.01 of its peak"),
    ],
)
def test_file_that_can_not_be_used(tmp_path, rows, message):
    with pytest.raises(ValueError, match=message) as caught:
        read_csv(written(tmp_path, *rows))
    assert "\n" not in str(caught.value)


def test_file_that_is_none(tmp_path):
    with pytest.raises(ValueError, match="no such file"):
        read_csv(tmp_path / "absent.csv")
    with pytest.raises(ValueError, match="is a folder, no regular file"):
        read_csv(tmp_path)
    binary = tmp_path / "binary.csv"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ValueError, match="not text in UTF-8"):
        read_csv(binary)
