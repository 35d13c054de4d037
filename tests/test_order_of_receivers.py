"""Receivers of a line that do not stand in the order of their positions; fields are exact."""

import numpy as np
import pytest
from pulses import ricker

from wavesim.records.record import RecordError, record

T = np.arange(1000) * 5e-7
X = 0.02 + 0.005 * np.arange(12)
TOLD = "do not stand in the order of their positions"


def noisy(u, part=1e-3):
    return u + part * np.abs(u).max() * np.random.default_rng(4).standard_normal(u.shape)


def passing(x, speed=3000.0):
    return ricker(T[:, None] - x / speed - 2e-5, 1e5, 3e-5)


def dispersive(x, k):
    """A burst of 100 kHz that goes as e^{i(kx − ωt)}, k(ω) in rad/m."""
    burst = np.exp(-(((T - 1e-4) / 2e-5) ** 2)) * np.cos(2e5 * np.pi * T)
    omega = 2 * np.pi * np.fft.rfftfreq(4 * len(T), T[1])
    U = np.fft.rfft(burst, 4 * len(T))[:, None] * np.exp(-1j * np.outer(k(omega), x))
    return np.fft.irfft(U, axis=0)[: len(T)]


UNEVEN = 0.02 + np.cumsum(np.random.default_rng(5).uniform(0.004, 0.008, 12))
FIELDS = {
    "one wave": (X, passing),
    "of five receivers": (X[:5], passing),
    "unevenly": (UNEVEN, passing),
    "two modes": (X, lambda x: passing(x) + 0.6 * passing(x, 1900.0)),
    "an echo": (X, lambda x: passing(x) - 0.7 * passing(2 * X[-1] + 0.01 - x)),
    # Phases run towards the source: at 100 kHz k = −250 rad/m, dω/dk = 3 km/s.
    "backward": (X, lambda x: dispersive(x, lambda w: -250 + (w - 2e5 * np.pi) / 3000)),
}


@pytest.mark.parametrize("field", FIELDS)
def test_receivers_out_of_order_are_told_whatever_passes(field, rng):
    """Law: a signal comes later and later along a line, and is few waves in that order alone."""
    x, wave = FIELDS[field]
    u, n = noisy(wave(x)), len(x)
    along = np.arange(n)
    for order in (along, along[::-1]):
        record(u[:, order], T, x)
    moved = np.insert(along[:0:-1], 2, 0)
    orders = [np.r_[along[:4][::-1], 4:n], moved, np.roll(along, 2), np.roll(moved, 2)]
    for order in [*orders, *(rng.permutation(n) for _ in range(3 * (n > 5)))]:
        with pytest.raises(RecordError, match=TOLD):
            record(u[:, order], T, x)


GOOD = {
    # By distance they come evenly too, but by that to both sides.
    "a source among them, a quarter off one": lambda x: passing(np.abs(x - X[5] - 0.00125) + 0.01),
    "a source between the first two": lambda x: passing(np.abs(x - X[1] + 0.001) + 0.01),
    "sources at both ends": lambda x: passing(x) + 0.8 * passing(0.1 - x),
    "standing waves": lambda x: sum(
        np.outer(np.cos(3000 * k * T + k), np.sin(k * (x - 0.01)))
        for k in np.pi * np.arange(3, 8) / 0.07
    ),
    "crosstalk that all hear at once": lambda x: passing(x) + 0.3 * passing(0 * x),
    "a slow mode that fades": lambda x: passing(x, 4500.0) + 9 * np.exp(-60 * x) * passing(x, 1500),
}


@pytest.mark.parametrize(
    ("seed", "speed", "loss"), [(13, 3000, 20), (27, 4000, 10), (45, 4000, 10)]
)
def test_a_source_among_receivers_whose_arrivals_are_doubtful_is_no_order(seed, speed, loss):
    """Law: put in the order of their distances to it they make one wave, as they do where they
    stand with those distances."""
    x = 0.02 + 0.005 * np.arange(24)
    away = np.abs(x - x[12] + 0.002)
    u = passing(away, speed) * np.exp(-loss * away)
    noise = np.random.default_rng(seed).standard_normal(u.shape)
    record(u + 0.03 * np.abs(u).max() * noise, T, x)


@pytest.mark.parametrize("field", GOOD)
def test_receivers_in_order_are_never_told_to_be_out_of_it(field):
    for n in (6, 9, 12):
        for part in (1e-3, 3e-2):
            record(noisy(GOOD[field](X[:n]), part), T, X[:n])
