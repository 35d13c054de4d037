"""How a measured record differs from a case's signals, told in parts.

    u_j(t) ≈ s φ(x_j, t − t₀) + c_j

Receiver by receiver: how much later it arrives than the case says, by correlation; how much larger
it is, over the gain that all share; and how its spectrum differs beside, as the rms of the level
over the band where it stands out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wavesim.readings.matched_record import Measured
from wavesim.simulation.bandlimited import between, cross_correlation

Float = NDArray[Any]

# More than this of the record left over says that it is not the case's alone.
LARGEST_RESIDUAL = 0.5
# And so much that goes with the signals, or of points, spoils what is read off it.
SPOILS = 0.01
UNLIKE = (
    "the case is another than what was measured, whoever's the columns are, or the record holds as "
    "much noise, drift or crosstalk beside"
)
# And this much, that nothing of the case is in it.
_NOTHING = 0.97
ABSENT = "nothing of the case is found in the record: it is of another test, or holds noise alone"
OFF = (
    "what is left over, {:.1%} of the record, goes with the signals and is no noise: the case's "
    "medium, bar or source is not quite what was measured, and the errors of lag and scale do not "
    "hold that"
)
# Spectra are compared where both have this part of their peak.
_IN_BAND = 0.1
# A correlation is looked at so many times between its samples.
_PARTS = 50
# Signals explain what is left over by so many copies to either side, told apart to this part.
_TAPS, _TOLD = 4, 1e-6
# Columns are laid otherwise by so many strongest frequencies, at so many lags to a period.
_FREQUENCIES, _TO_A_PERIOD = 256, 16


@dataclass(frozen=True)
class ReceiverMisfit:
    """How a receiver's record differs from the case.

    Attributes:
        name, position: of the receiver, m.
        residual: rms of what is left over the record's, –.
        arrival: by how much it comes later than the case says, s.
        amplitude: how much larger it is, over the common scale, –; negative where its polarity is
            the other one.
        spectrum: rms of the level's difference over the band, that amplitude apart, dB.
    """

    name: str
    position: float
    residual: float
    arrival: float
    amplitude: float
    spectrum: float


@dataclass(frozen=True)
class Comparison:
    """A record beside a case.

    Attributes:
        measured: the record.
        simulated: the case's signals on its times and in its unit, shape (nt, m).
        receivers: misfits.
        lag, lag_error: t₀, s; NaN error where it was stated.
        scale, scale_error: s, unit of the record over that of the field.
        residual: rms of all that is left, over the record's, –.
        systematic: the part of that which goes with the signals, as :func:`goes_with` has it, –.
        otherwise: how the record lies on the case much better than as it is matched, or "".
    """

    measured: Measured
    simulated: Float
    receivers: tuple[ReceiverMisfit, ...]
    lag: float
    lag_error: float
    scale: float
    scale_error: float
    residual: float
    systematic: float
    otherwise: str = ""

    @property
    def notes(self) -> tuple[str, ...]:
        """Those of the record, and what is wrong with how it lies on the case."""
        wrong = self.otherwise
        if not wrong and self.residual > LARGEST_RESIDUAL:
            wrong = ABSENT if self.residual > _NOTHING else UNLIKE
        elif not wrong and self.systematic > SPOILS and self.lag_error + self.scale_error >= 0:
            wrong = OFF.format(self.systematic)
        return (*self.measured.notes, *([wrong] if wrong else []))

    def summary(self) -> dict[str, Any]:
        """As plain data, SI."""
        return {
            "field": self.measured.field,
            "lag": self.lag,
            "lag_error": self.lag_error,
            "scale": self.scale,
            "scale_error": self.scale_error,
            "residual": self.residual,
            "systematic": self.systematic,
            "receivers": [dict(vars(one)) for one in self.receivers],
            "notes": list(self.notes),
        }


def misfit(
    name: str, position: float, u: Float, there: Float, left: Float, step: float
) -> ReceiverMisfit:
    """Misfit of one receiver.

    Args:
        name, position: of it, m.
        u, there: recorded and simulated, shape (nt,), one unit.
        left: what is left of the record, shape (nt,).
        step: Δt, s.
    """
    there = there - there.mean()
    c = cross_correlation(u, there)
    # The top between samples, of four to a period even; of a reversed receiver it is a hollow.
    sign = 1.0 if c.max() >= -c.min() else -1.0
    c = sign * c
    near = int(np.argmax(c)) + np.linspace(-1, 1, 2 * _PARTS + 1)
    shown = between(c, near)
    at = int(np.clip(np.argmax(shown), 1, 2 * _PARTS - 1))
    a, b, d = shown[at - 1 : at + 2]
    bend = a - 2 * b + d
    top = near[at] + (0.5 * float((a - d) / bend) if bend < 0 else 0.0) / _PARTS
    power = float(np.sum(there**2)) or 1.0
    amplitude = sign * float(b) / power
    U, T = np.abs(np.fft.rfft(u)), np.abs(np.fft.rfft(there))
    band = (_IN_BAND * U.max() < U) & (_IN_BAND * T.max() < T)
    level = 20 * np.log10(U[band] / T[band]) if band.any() else np.array([np.nan])
    return ReceiverMisfit(
        name,
        position,
        float(np.sqrt(np.mean(left**2) / np.mean(u**2))),
        (top - (len(there) - 1)) * step,
        amplitude,
        float(np.std(level)),
    )


def goes_with(there: Float, left: Float, positions: ArrayLike, lag: float) -> float:
    """The part of what is left over that the signals explain, of its power, –.

    Where the waves are another medium's, or the pulse another, what is left is near

        r_j(t) = Σ_l (a_l + b_l x_j) φ(x_j, t − l τ),     l = −4 … 4,

    a and b by least squares; noise of any kind, and times that jitter, hardly ever are.

    Args:
        there: signals, shape (nt, m).
        left: what is left over, shape (nt, m).
        positions: x_j, shape (m,), m.
        lag: τ in samples, a quarter of a period or so.
    """
    x = np.asarray(positions, float)
    x = (x - x.mean()) / (np.ptp(x) or 1.0)
    there, left = (part - part.mean(axis=0) for part in (there, left))
    reach = _TAPS * max(1, round(lag))
    calm = np.pad(there, ((reach, reach), (0, 0)))
    at = np.linspace(0, 2 * reach, 2 * _TAPS + 1).astype(int)
    moved = [calm[first : first + len(there)] for first in at]
    columns = np.stack([(part * by).ravel() for part in moved for by in (1.0, x)], axis=1)
    found = np.linalg.lstsq(columns, left.ravel(), _TOLD)[0]
    power = float(np.sum(left**2)) or 1.0
    return max(0.0, 1 - float(np.sum((left.ravel() - columns @ found) ** 2)) / power)


def laid_otherwise(
    recorded: Float, there: Float, step: float, begin: float, reach: float
) -> tuple[NDArray[np.int_], Float, float]:
    """How columns lie on a case's signals best, whosever they are said to be.

    With one lag t₀ for all, that assignment π with signs that explains most, Σ_j |c_jπ(j)(t₀)| of
    the correlations.

    Args:
        recorded, there: recorded and simulated signals, shapes (nt, m) and (N, m), without offset.
        step: Δt of both, s.
        begin: of the record on the clock of the case, s.
        reach: largest |t₀|, s.

    Returns:
        π, the column that is each receiver's, and its sign, shape (m,); t₀, s.
    """
    from scipy.optimize import linear_sum_assignment  # slow to import, and few comparisons need it

    size = len(recorded) + len(there)
    U, V = (np.fft.rfft(part, size, axis=0) for part in (recorded, there))
    loud = np.sum(np.abs(U) * np.abs(V), axis=1)
    some = np.argsort(loud)[-_FREQUENCIES:]
    omega = 2 * np.pi * some / (size * step)
    centre = float(np.sum(omega * loud[some]) / np.sum(loud[some]))
    lags = np.arange(-reach, reach, 2 * np.pi / centre / _TO_A_PERIOD)
    both = (np.conj(V[some, :, None]) * U[some, None, :]).reshape(len(some), -1)
    best: tuple[float, Any, Any, float] = (-1.0, None, None, 0.0)
    for lag in lags.tolist():
        c = (np.exp(1j * omega * (lag - begin)) @ both).real.reshape(V.shape[1], -1)
        rows, columns = linear_sum_assignment(-np.abs(c))
        found = c[rows, columns]
        if np.abs(found).sum() > best[0]:
            best = float(np.abs(found).sum()), columns, np.sign(found), lag
    return best[1], best[2], best[3]
