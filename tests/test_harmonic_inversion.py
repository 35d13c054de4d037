"""Harmonic inversion: exact without noise, honest with it, and the right number of waves."""

from __future__ import annotations

import numpy as np
import pytest
from exact import references
from media import unit_wavenumber

from wavesim.grid.stencils import modified_wavenumber
from wavesim.material.granular_equations import ROTATION
from wavesim.planewave.dispersion_relation import block_frequencies
from wavesim.readings.dispersion.frequency_at_wavenumber import in_time, series
from wavesim.readings.dispersion.harmonic_inversion import invert
from wavesim.readings.dispersion.sinusoids import fit
from wavesim.records.fitness import for_frequency_at_k
from wavesim.records.record import record as as_record
from wavesim.verdict.recovered_points import match


def sinusoids(omega, decay, amplitude, count):
    """Re Σ a e^{−(γ+iω)t} at t = 0, 1, …: channels (C, N)."""
    t = np.arange(count)
    z = np.exp(-np.multiply.outer(decay + 1j * omega, t))
    return np.real(amplitude @ z)


def test_exact_sinusoids_to_rounding(rng):
    # Law: y = Re Σ a e^{−(γ+iω)t}. 760 samples, 6 channels, amplitudes from 1 to 2e-6. Tolerance:
    # the phase rounding 1e-16·N over amplitude; measured 8e-14 on the weakest, 3e-16 on the others.
    omega, decay = np.array([0.05, 0.4, 0.41, 1.1, 2.9]), np.array([0, 2e-4, 0, -1e-4, 3e-3])
    amplitude = np.exp(2j * np.pi * rng.random((6, 5))) * [1, 0.5, 0.7, 2e-6, 0.1]
    found = invert(sinusoids(omega, decay, amplitude, 760)[None], 1.0)
    assert len(found.omega) == 5
    assert np.abs(found.omega / omega - 1).max() < 2e-12
    assert np.abs(found.decay - decay).max() < 1e-12
    assert found.amplitude == pytest.approx(np.linalg.norm(amplitude, axis=0), rel=1e-9)
    assert found.settled.all()
    assert found.residual.max() < 1e-24


def test_a_constant_has_no_phase(rng):
    """Of many sinusoids laid through an offset one tends to ω = 0, where its sine is nothing."""
    series = (1.0 + 1e-3 * np.arange(800) + 1e-3 * rng.normal(size=800))[None, None]
    omega = [0.99, 0.053, 0.0516, 0.0024, 0.0636, 1e-18, 0.0222, 0.0467, 0.0324, 0.0069]
    decay = [0.0, -0.002, 0.046, 0.005, 0.006, 0.04, -9e-4, 1.6e-3, -1.7e-3, 6.8e-3]
    found = fit(series, np.array([omega]), np.array([decay]))
    assert np.isfinite(found.omega).all()
    assert np.isfinite(found.unit).all()


@pytest.mark.parametrize("apart", [0.6, 1.0, 1.5])
def test_two_waves_within_a_bin_or_so_are_told_apart(apart):
    # 512 samples without noise, apart by these parts of a bin 2π/N. Measured: 3e-14, 2e-15, 4e-16.
    omega = 0.7 + np.array([0, apart]) * 2 * np.pi / 512
    found = invert(sinusoids(omega, np.zeros(2), np.array([[1.0, 0.6j]]), 512)[None], 1.0)
    assert len(found.omega) == 2
    assert np.abs(found.omega / omega - 1).max() < 1e-11


def test_missing_frames_cost_no_accuracy(rng):
    # Every frame a coin's throw away: the fit knows which frames there are. Measured 2e-15.
    omega = np.array([0.3, 0.9])
    series_ = sinusoids(omega, np.zeros(2), np.array([[1.0, 0.3]]), 600)[None]
    gone = np.zeros(600, bool)
    gone[100:180] = gone[300:311] = True
    series_[..., gone] = np.nan
    found = invert(series_, 1.0, missing=gone)
    assert len(found.omega) == 2
    assert np.abs(found.omega / omega - 1).max() < 1e-12


def test_white_noise_holds_no_wave(rng):
    # False alarms are set to 1e-6 of the series: none in 500 of them, of two channels.
    assert len(invert(rng.normal(size=(500, 2, 300)), 1.0).omega) == 0


def test_noise_along_a_line_or_round_a_ring_holds_no_wave(rng):
    """Every frame at every receiver: there is no point at all, and no error."""
    u, x, t = rng.normal(size=(300, 24)), 0.1 * np.arange(24), 1e-4 * np.arange(300)
    for ring in (False, True):
        found = in_time(for_frequency_at_k(as_record(u, t, x, ring=ring)), method="harmonic")
        assert not found.valid.any()


def test_channels_of_unequal_noise_are_weighed(rng):
    # One quiet channel among loud ones decides. Law: Cramér–Rao, var ω = 12 σ²/(A² N³)·2/A-channel;
    # with σ = 1e-4 on a channel of amplitude 1 and N = 400 that is 4.3e-8 rad. Measured 4.4e-8.
    clean = sinusoids(np.array([0.8]), np.zeros(1), np.ones((3, 1)), 400)
    noise = rng.normal(size=(200, 3, 400)) * np.array([1e-4, 0.1, 0.1])[:, None]
    found = invert(clean + noise, 1.0, damped=False)
    assert len(found.omega) == 200
    bound = np.sqrt(24 * 1e-8 / 400**3)
    assert np.std(found.omega - 0.8) == pytest.approx(bound, rel=0.2)
    assert np.mean(found.omega_error) == pytest.approx(bound, rel=0.2)


@pytest.mark.parametrize("closure", ["printed", "consistent"])
def test_all_twelve_waves_of_the_shipped_case(closure, simulated, recovered):
    """|Δω|/ω ≤ 1e-8 against the grid's relation, ≤ 1e-5 against the continuum up to k̄ = 0.5.

    Default grid (l/8, order 8), 2048 cells, T = 380 units after the pulse, k̄ 0.02 to 1, every wave
    with more than 1e-6 of the strongest amplitude at its k. Measured: 4.3e-12 and 5.7e-8 (printed,
    a = 0.25), 1.2e-12 and 6e-8 (consistent, a = 0.5); none missed, none false.
    """
    field = simulated(closure)
    unit = unit_wavenumber(field.medium)
    waves = 0
    for block, record, points in recovered(closure):
        matched = match(
            points, record, block.branches, *references(field, block), (0.02 * unit, unit)
        )
        waves += int(matched.present.any(axis=0).sum())
        assert matched.missed.sum() == 0
        assert len(matched.false_k) == 0
        assert matched.found.sum() > 0.9 * matched.present.shape[0] * len(block.branches)
        assert np.nanmax(matched.error(False)) < 1e-8
        short = matched.k <= 0.5 * unit
        assert np.nanmax(matched.error(True)[short]) < 1e-5
        # The relation held against is the solver's at the stencil's modified wavenumber.
        k = modified_wavenumber(matched.k, field.bar.spacing, field.bar.order)
        own = block_frequencies(field.medium, block, k)
        assert np.abs(matched.grid / own - 1).max() < 1e-13
        assert len(points.branches) == len(block.branches)
    assert waves == 12


@pytest.fixture(scope="module")
def noisy(simulated, recovered):
    """Longitudinal waves at 13 wavenumbers, 50 seeds, with noise: what was found."""
    field = simulated("printed")
    record = recovered("printed")[0][1].since(field.quiet_from)
    unit = unit_wavenumber(field.medium)
    k = 2 * np.pi * np.arange(1, 1025) / record.aperture
    rows = np.flatnonzero((k >= 0.02 * unit) & (k <= 0.5 * unit))[::10]
    kt = modified_wavenumber(k[rows], field.bar.spacing, field.bar.order)
    exact = block_frequencies(field.medium, ROTATION.blocks[0], kt)
    peaks = np.abs(record.values).max(axis=(1, 2))
    clean = np.stack(
        [part for v in record.values for hat in [np.fft.rfft(v, axis=1).T[1 + rows]]
         for part in (hat.real, hat.imag)], axis=1
    )  # fmt: skip
    # White noise on every receiver is white in every real and imaginary part, with variance nx/2.
    spread = np.repeat(peaks, 2)[:, None] * np.sqrt(len(record.x) / 2)
    rng = np.random.default_rng(4)
    answers = {}
    for noise in (0.01, 0.05):
        many = np.concatenate(
            [clean + noise * spread * rng.normal(size=clean.shape) for _ in range(50)]
        )
        answers[noise] = (invert(many, record.interval), exact)
    return answers


@pytest.mark.parametrize("noise", [0.01, 0.05])
def test_error_bars_hold_the_truth(noisy, noise):
    """95 % bars hold 90–99 % of the truth; bias below a third of the bar; none missed or false.

    Noise of 1 % and 5 % of each component's peak, 50 seeds, 13 wavenumbers, three branches: 650
    points a branch. Measured: 0.94 to 0.95 and bias at most 0.04 of the bar over all points.
    """
    found, exact = noisy[noise]
    count = len(exact)
    every = exact[found.series % count]
    nearest = np.argmin(np.abs(every - found.omega[:, None]), axis=1)
    error = found.omega - every[np.arange(len(nearest)), nearest]
    bar = 1.96 * found.omega_error
    assert found.settled.all()
    for branch in range(3):
        own = nearest == branch
        assert own.sum() == 50 * count
        assert 0.90 <= np.mean(np.abs(error[own]) <= bar[own]) <= 0.99
        assert abs(np.mean(error[own] / bar[own])) < 1 / 3
        # At each wavenumber apart: a mean over 50 seeds is itself uncertain by 0.07 of the bar.
        for row in range(count):
            here = own & (found.series % count == row)
            assert abs(np.mean(error[here] / bar[here])) < 1 / 3


def test_a_long_record_is_taken_whole():
    """4,096 frames: every wave of three branches at 64 wavenumbers, and no other."""
    k, t = np.linspace(0.01, np.pi, 64), np.arange(4096)
    waves = [np.sin(k / 2) * 1.2 + 2e-3, 1.5 + 0.3 * np.cos(k), 2.3 + 0.2 * k / np.pi]
    hat = sum(
        a * np.exp(-1j * np.multiply.outer(w, t)) for a, w in zip((1, 0.5, 0.1), waves, strict=True)
    )
    found = invert(np.stack([hat.real, hat.imag], axis=1), 1.0)
    assert len(found.omega) == 3 * len(k)


def test_fft_route_sees_every_branch_to_its_own_accuracy(simulated, recovered):
    # The plain route on the same record: peaks of a Blackman–Harris window padded twice. Its bar
    # is the window's shape error; measured median 3e-6 of ω, largest 6e-6 clear of the main lobe.
    block, record, points = recovered("printed", "fft")[0]
    field = simulated("printed")
    unit = unit_wavenumber(field.medium)
    judged = (0.02 * unit, unit / 2)
    matched = match(points, record, block.branches, *references(field, block), judged)
    assert len(points.branches) == 3
    assert np.nanmedian(matched.error(False)) < 1e-5
    assert (np.abs(matched.omega - matched.grid) <= matched.bar)[matched.found].mean() > 0.95


def test_a_record_needs_enough_frames_and_wavenumbers(recovered):
    record = recovered("printed")[0][1]
    with pytest.raises(ValueError, match=r"at least 16 are needed"):
        record.since(record.t[-8])
    with pytest.raises(ValueError, match=r"at least 3 are needed"):
        series(record, 20.0)
    with pytest.raises(ValueError, match=r"must be one of harmonic, fft"):
        in_time(record, method="music")
    with pytest.raises(ValueError, match="needs at least 16"):
        invert(np.zeros((1, 1, 8)), 1.0)
    with pytest.raises(ValueError, match="not finite"):
        invert(np.full((1, 1, 64), np.nan), 1.0)
