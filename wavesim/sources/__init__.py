"""Sources: signals in time and in frequency, by kind. Jax goes through, but is not needed."""

from wavesim.sources.bursts import Chirp, ToneBurst
from wavesim.sources.excitation import excitation, excited_band
from wavesim.sources.initial_field import InitialField
from wavesim.sources.recorded_signal import Recorded
from wavesim.sources.ricker import GaussianDerivative, Ricker
from wavesim.sources.signal_file import read_csv
from wavesim.sources.source import EXCITED, Drive, Source, parameters

__all__ = [
    "EXCITED",
    "Chirp",
    "Drive",
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
]
