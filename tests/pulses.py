"""Pulses of known truth along a line: in closed form, or by an inverse FFT along ω + iσ."""

import numpy as np


def ricker(t, peak_frequency, delay):
    u2 = (np.pi * peak_frequency * (t - delay)) ** 2
    return (1 - 2 * u2) * np.exp(-u2)


def through(k, t, signal, x):
    """Signals at distances x of a wave exp(i(k(ω)x − ωt)), from one at x = 0, shape (nt, nx).

    Along ω + iσ the transform is that of a signal weighted by exp(−σt), which has ended when the
    padded record wraps: what wraps is exp(−σT) = 2e-9 of it.
    """
    n, step = 8 * len(t), t[1] - t[0]
    sigma = 20 / (n * step)
    time = np.arange(n) * step
    padded = np.concatenate([signal, np.zeros(n - len(t))]) * np.exp(-sigma * time)
    omega = 2 * np.pi * np.fft.rfftfreq(n, step)
    # numpy's sign of i is the other one.
    entered = np.conj(np.fft.rfft(padded))
    there = entered[:, None] * np.exp(1j * np.multiply.outer(k(omega + 1j * sigma), x))
    return (np.fft.irfft(np.conj(there), n, axis=0) * np.exp(sigma * time)[:, None])[: len(t)]


def lorentz(speed, lowest, highest):
    """k(ω) of k² = ω²/c² (ω_L² − ω²)/(ω_T² − ω²): a gap from ω_T to ω_L, Im k ≥ 0."""

    def k(omega):
        omega = np.asarray(omega, complex)
        root = omega / speed * np.sqrt((highest**2 - omega**2) / (lowest**2 - omega**2))
        return np.where(root.imag < 0, -root, root)

    return k


def named(values, x):
    """({name: signal}, {name: position}) of the columns of an array."""
    names = [f"r{j}" for j in range(len(x))]
    return dict(zip(names, values.T, strict=True)), dict(zip(names, x, strict=True))
