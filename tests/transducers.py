"""Made-up records of a transmitter and a receiver in grains, of known truth."""

import numpy as np

INTERVAL, BEGIN, COUNT = 2.6e-6, -2.057e-4, 1600
FREQUENCY = 1e4


def lossy(omega, speed, quality):
    """k(ω) of constant Q, c(10 kHz) = speed. Kjartansson, J. Geophys. Res. 84, 4737 (1979)."""
    gamma = np.arctan(1 / quality) / np.pi
    turn = -1j * np.maximum(omega, 1e-9) / (2 * np.pi * FREQUENCY)
    return omega * np.real((-1j) ** gamma) / (speed * turn**gamma)


def record(speed, distance=0.12, quality=18.0, precursor=0.12, guided=1.3, crosstalk=0.25,
           creep=0.09, noise=0.01, bits=8, seed=0, delay=0.0, cycles=1):  # fmt: skip
    """(t, sent, received): a sine of some cycles sent; a P wave, the S wave at ``speed``, a guided
    one."""
    rng = np.random.default_rng(seed)
    n = 8 * COUNT
    t = BEGIN + INTERVAL * np.arange(n)
    omega = 2 * np.pi * np.fft.rfftfreq(n, INTERVAL)
    sent = np.where((t >= 0) & (t <= cycles / FREQUENCY), np.sin(2 * np.pi * FREQUENCY * t), 0.0)
    spectrum = np.fft.rfft(sent)

    def path(c, q=quality):
        k = lossy(omega, c, q) * distance + omega * delay
        return np.fft.irfft(spectrum * np.conj(np.exp(1j * k)), n)[:COUNT]

    t, sent = t[:COUNT], sent[:COUNT]
    wave = path(speed) + precursor * path(1.7 * speed) + guided * path(0.72 * speed, 30.0)
    wave /= np.abs(wave).max()
    electric = np.gradient(sent)
    wave += crosstalk * electric / np.abs(electric).max()
    wave -= np.where(t > 0, creep * np.exp(-np.maximum(t, 0) / 6e-4), creep)
    wave += noise * rng.standard_normal(COUNT)
    step = 2.4 / 2**bits
    written = np.array([float(f"{v:.5g}") for v in t])
    return written, 128 * np.round(sent, 2), 0.014 * step * np.round(wave / step)
