"""Recordings of sound (.wav), by scipy: channels side by side, times by the rate."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from wavesim.records.content import Content, check_size


def from_wav(path: Path) -> Content:
    """Channels of a .wav file, in its own units; it says no positions."""
    from scipy.io import wavfile

    rate, stored = wavfile.read(path, mmap=True)
    check_size(stored.shape, "values")
    values = np.array(stored if stored.ndim == 2 else stored[:, None])
    labels = tuple(f"channel {j}" for j in range(1, values.shape[1] + 1))
    t = np.arange(len(values)) / rate
    said = f"times by the file's rate, {rate} samples/s"
    return Content({"values": values, "t": t}, {}, labels, notes=[said], settled={"t"})
