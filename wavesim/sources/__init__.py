"""Sources: signals in time and in frequency, by kind. Jax goes through, but is not needed."""

from wavesim.sources.initial_field import InitialField
from wavesim.sources.recorded_signal import Recorded
from wavesim.sources.ricker_and_gaussian import GaussianDerivative, Ricker
from wavesim.sources.signal_file import read_csv
from wavesim.sources.signal_generator import Chirp, ToneBurst
from wavesim.sources.source import (
    EXCITED,
    Source,
    excitation,
    excited_band,
    parameters,
    unfolded,
)

__all__ = [
    "EXCITED",
    "Chirp",
    "GaussianDerivative",
    "InitialField",
    "Recorded",
    "Ricker",
    "Source",
    "ToneBurst",
    "excitation",
    "excited_band",
    "parameters",
    "read_csv",
    "unfolded",
]
