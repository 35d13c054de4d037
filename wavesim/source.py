"""Sources: signals in time and in frequency, by kind. Jax goes through, but is not needed."""

from wavesim.sources.base import EXCITED, Drive, Source, parameters
from wavesim.sources.bursts import Chirp, ToneBurst
from wavesim.sources.excitation import excitation, excited_band
from wavesim.sources.initial import InitialField
from wavesim.sources.pulses import GaussianDerivative, Ricker
from wavesim.sources.recorded import Recorded
from wavesim.sources.samples import read_csv

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
