"""One transmitter and one receiver: what was sent, what came through, and what is crosstalk of it.

The commonest pulse test there is. Crosstalk is electrical: it comes with what is sent, whatever the
distance, and is left out by its time. The base under the signal creeps away from the trigger on; it
is what changes more slowly than any wave of the pulse.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wavesim.readings.pulse import crosstalk
from wavesim.readings.pulse.central_band import band_about, central_period
from wavesim.readings.pulse.first_break import envelope
from wavesim.readings.pulse.sent_signal import sent_period, what_was_sent
from wavesim.readings.pulse.signals import (
    CLIPPED,
    PulseError,
    checked,
    even_time_axis,
    finely,
    marked,
)
from wavesim.records.faults.clipping import clipped
from wavesim.records.faults.finding import Finding
from wavesim.records.faults.quantisation import quanta

Float = NDArray[Any]

MARK = "a mark of overload, no signal: record it again with less gain"
# Crosstalk stands this many deviations above the noise, and this part of the largest amplitude,
# within that part of a period after the start.
HEARD, _LEAST, _AT_ONCE = 4.5, 0.02, 0.4
# A wave that ends what crosstalk explains has broken this part of a period before.
_ALREADY = 0.5
# What is left of known crosstalk may reach this part of its peak; no wave comes within this part of
# a period.
_DOUBTFUL, _SOONEST = 0.15, 0.25
# A wave of this part of the largest that stands when crosstalk ends, and for this part of a period,
# began within it; of the second where crosstalk was heard for longer than 1.5 lengths.
_COVERED, _AT_END = (0.45, 0.2), 0.25
# So many times its size as the pulse begins, what stands in crosstalk's time is a wave.
_GROWN = 3.0
# Where nothing says how long it was sent, what rises out of crosstalk of this part of the largest
# may be more of it.
STRONG = 0.45
# A wave on crosstalk that explains itself no further is so many times as large.
_WAVE = 1.5
_LENGTHS = 1.5
_FEWEST_BEFORE, _FEWEST_AFTER = 16, 64
# Larger values no instrument gives, and squares of them overflow.
_LARGEST = 1e100


@dataclass(frozen=True)
class TransmissionRecord:
    """A record of one receiver, made ready to be read.

    Attributes:
        name: of the record.
        t: even times, shape (nt,), s.
        sent: what was sent, without its base, shape (nt,); None where it was not recorded.
        start, length: when it begins and how long it lasts, s.
        got: what was received, without offset and creep, 0 up to ``blank``, shape (nt,).
        got_before: the same before the start.
        raw: the same as it was recorded, without its offset and the crosstalk that is known.
        crosstalk_taken: the crosstalk that is known, shape (nt,), unit of u; 0 where none is.
        noise: standard deviation of ``raw`` before the start, unit of u; NaN where unknown.
        blank: time up to which crosstalk hides the signal, s.
        crosstalk: its peak over that of ``got``, –; 0 where there is none.
        period: of the central frequency of what came through, s.
        covered: whether a large wave is there already as crosstalk ends.
        unended: whether something is heard still where crosstalk is taken to end at the latest.
        risen: whether something rose out of crosstalk before that had died away.
        unusable: why amplitudes tell nothing, or "".
        notes: what was put right.
        sampled: interval of the samples as they were recorded, s.
    """

    name: str
    t: Float
    sent: Float | None
    start: float
    length: float
    got: Float
    got_before: Float
    raw: Float
    crosstalk_taken: Float
    noise: float
    blank: float
    crosstalk: float
    period: float
    covered: bool
    unended: bool
    risen: bool
    unusable: str
    notes: tuple[str, ...]
    sampled: float

    @property
    def interval(self) -> float:
        """Δt, s."""
        return float(self.t[-1] - self.t[0]) / (len(self.t) - 1)

    @cached_property
    def rise(self) -> float:
        """How long what is sent takes to half of its envelope's peak, s; 0 where not recorded."""
        if self.sent is None:
            return 0.0
        # An envelope peaks where a square turns over, not where it begins.
        size = np.minimum(envelope(self.sent), np.abs(self.sent).max())
        return max(0.0, float(self.t[int(np.argmax(size >= size.max() / 2))]) - self.start)

    @property
    def noise_in_band(self) -> float:
        """Standard deviation of ``got`` before the start, unit of u; NaN where it is unknown."""
        early = self.got_before
        return float(np.std(early)) if len(early) >= _FEWEST_BEFORE else float("nan")


def transmission_record(
    t: ArrayLike,
    received: ArrayLike,
    sent: ArrayLike | None = None,
    name: str = "record",
    start: float = 0.0,
) -> TransmissionRecord:
    """Make a record ready to be read.

    Args:
        t: times, shape (nt,), s; even, or rounded from even ones.
        received: the receiver's signal, shape (nt,), any unit.
        sent: the transmitter's, shape (nt,), any unit; None where it was not recorded.
        name: of the record, for messages.
        start: when it was sent, s, where ``sent`` is None.

    Returns:
        The record.

    Raises:
        PulseError: times or values can't be used, or nothing was sent or received.
    """
    time, notes = even_time_axis(t)
    u = checked("receiver", received, time)
    found: list[Finding] = []
    if marked(u[:, None], time, np.array([np.nan]), (name,), found).any():
        raise PulseError(f"{found[-1].size} ({found[-1].where}) is {MARK}")
    length, v = 0.0, None if sent is None else checked("transmitter", sent, time)
    for whose, row in (("receiver", u), ("transmitter", v)):
        if row is not None and np.abs(row).max() > _LARGEST:
            raise PulseError(
                f"the {whose}'s signal reaches {np.abs(row).max():.3g}: is it its own?"
            )
    step = float(quanta(u[None, :, None])[0])
    flat = bool(clipped(u[None, :, None], np.array([step]))[0][0])
    sampled = float(time[-1] - time[0]) / (len(time) - 1)
    time, u, v, said = finely(time, u, v)
    notes += said
    if v is not None:
        start, length, v = what_was_sent(time, v)
    before = int(np.searchsorted(time, start - 0.5 * (time[1] - time[0])))
    early = u[1:before]
    known = len(early) >= _FEWEST_BEFORE
    raw = u - float(np.median(early if known else u))
    if not np.abs(raw).max() > 0:
        raise PulseError("the receiver's signal is constant: is its column the right one?")
    noise = max(_deviation(early), step / np.sqrt(12)) if known else np.nan
    if flat:
        notes.append("flat tops: the receiver's signal is clipped; lower the gain")
    ready = TransmissionRecord(
        name, time, v, start, length, raw, raw[:0], raw, np.zeros(len(raw)), noise, start,
        0.0, 0.0, False, False, False, CLIPPED if flat else "", tuple(notes), sampled,
    )  # fmt: skip
    return _ready(ready)


def _deviation(part: Float) -> float:
    """Standard deviation about a parabola, so that a creeping base counts for none."""
    n = np.arange(len(part), dtype=float)
    return float(np.std(part - np.polynomial.Polynomial.fit(n, part, 2)(n), ddof=3))


def _ready(found: TransmissionRecord) -> TransmissionRecord:
    """Without crosstalk and creep."""
    t, raw, dt = found.t, found.raw, found.interval
    _check_length(found, found.start + _LENGTHS * found.length)
    rough = sent_period(found.sent, dt) or _central_period(
        found, raw, found.start + _LENGTHS * found.length
    )
    band = band_about(raw, dt, rough)
    size = envelope(band)
    quiet = band[: int(np.searchsorted(t, found.start - 0.25 * rough))]
    # Where nothing before it tells the noise, the quietest tenth of the record does.
    known = len(quiet) >= _FEWEST_BEFORE
    noise = float(np.std(quiet) if known else np.percentile(size, 10) / 1.25)
    # It comes with what is sent, when no wave can have come yet.
    inside = (t >= found.start) & (t <= found.start + found.rise + _AT_ONCE * rough)
    peak = float(size[inside].max()) if inside.any() else 0.0
    blank, part, unended, risen = found.start, 0.0, False, False
    heard = max(HEARD * noise, _LEAST * float(size.max()))
    if peak > heard and _at_once(raw, inside, dt, rough) > heard:
        part = peak
        own = None
        if found.sent is not None:
            own = crosstalk.modelled(
                t, found.sent, raw, found.start, found.length, rough, noise,
                lambda row: band_about(row, dt, rough),
            )  # fmt: skip
        until = None
        if own is not None and _follows_crosstalk(found, size, rough, own[1]):
            own = None
        if own is not None:
            until = found.start + own[1]
            found = replace(found, raw=raw - own[0], crosstalk_taken=own[0])
            size = envelope(band_about(found.raw, dt, rough))
        blank, unended, risen = _over(found, size, peak, rough, noise, until)
    found = replace(found, crosstalk=part, period=rough, unended=unended, risen=risen)
    return blanked(found, blank)


def _follows_crosstalk(found: TransmissionRecord, size: Float, period: float, until: float) -> bool:
    """Whether crosstalk goes on past what explains it: that ends while the pulse is being sent, and
    nothing as large as a wave beside it follows."""
    after = found.t - found.start
    rest = (after > until) & (after < _LENGTHS * found.length + period)
    largest = float(size[(after >= 0) & (after <= until)].max())
    return until < found.length and float(size[rest].max(initial=0.0)) < _WAVE * largest


def _at_once(raw: Float, inside: NDArray[np.bool_], dt: float, period: float) -> float:
    """Peak of the envelope when no wave can have come, without what the filter draws there from a
    wave that follows."""
    end = int(np.flatnonzero(inside)[-1]) + 1
    held = raw.copy()
    held[end:] = raw[end - max(1, int(0.05 * period / dt)) : end].mean()
    return float(envelope(band_about(held, dt, period))[inside].max())


def _over(
    found: TransmissionRecord,
    size: Float,
    peak: float,
    rough: float,
    noise: float,
    until: float | None,
) -> tuple[float, bool, bool]:
    """When crosstalk is over, s, whether it was heard still at the latest, and whether something
    rose out of it before it had died away.

    Args:
        found: the record, what is known of its crosstalk taken out.
        size: its envelope, shape (nt,).
        peak: of the crosstalk.
        rough: period, s.
        noise: of the envelope.
        until: time up to which the crosstalk is known and nothing else is there, s; None where it
            is not known.
    """
    t = found.t
    latest = _latest(found, rough)
    # Of what was not recorded the length is not known: it is over after its top.
    at_once = (t >= found.start) & (t <= found.start + found.rise + _AT_ONCE * rough)
    begin = int(np.argmax(np.where(at_once, size, 0.0)))
    begin = max(begin, int(np.searchsorted(t, found.start + found.length, "right")))
    at, rises, died = crosstalk.falls(size[begin:], peak, 3 * noise)
    over = float(t[begin + at])
    if not died:
        over = max(over, min(latest, float(t[begin + rises - 1])))
    if until is None:
        # What falls for so long is no longer told from the foot of a wave.
        return over, not died or over > latest, not died
    over = min(over, latest)
    # What is left of it beyond may not be what is known of it, but for a larger wave.
    waves = np.flatnonzero((t >= until) & (size > max(_DOUBTFUL * peak, 3 * noise)))
    first = float(t[waves[0]]) if len(waves) else over
    return min(max(first - _ALREADY * rough, found.start + _SOONEST * rough), over), False, False


def _latest(found: TransmissionRecord, period: float) -> float:
    """When crosstalk is over but for what has fallen all the while, s."""
    return found.start + max(_LENGTHS * found.length, period)


def blanked(found: TransmissionRecord, blank: float) -> TransmissionRecord:
    """The record with all up to a time left out, and its base taken out of the rest.

    Args:
        found: the record.
        blank: s.
    """
    t, dt = found.t, found.interval
    _check_length(found, blank)
    first = int(np.searchsorted(t, blank))
    u = found.raw.copy()
    early = int(np.searchsorted(t, found.start))
    level = float(np.median(u[first : first + max(3, int(0.2 * found.period / dt))]))
    if first > early:
        u[early:first] = np.linspace(0.0, level, first - early)
    period = _central_period(found, u, blank)
    got = band_about(u, dt, period)
    quiet = got[: max(0, early - int(0.25 * period / dt))].copy()
    got[:first] = 0.0
    largest = float(np.abs(got).max() or 1.0)
    part = found.crosstalk / largest if found.crosstalk else 0.0
    covered = False
    if part:
        whole = envelope(band_about(found.raw, dt, period))
        size = whole[first:]
        at_end = size[: max(1, int(_AT_END * period / dt))]
        long = found.unended and blank > _latest(found, found.period)
        covered = float(at_end.min()) > _COVERED[int(long)] * float(size.max())
        covered |= found.risen and found.sent is None and part > STRONG
        # What grows so far while crosstalk is heard is no more of it.
        within = float(whole[early:first].max(initial=0.0))
        covered |= within > max(_GROWN * found.crosstalk, _COVERED[0] * float(size.max()))
    return replace(
        found, got=got, got_before=quiet, blank=blank, crosstalk=part, period=period,
        covered=covered,
    )  # fmt: skip


def _central_period(found: TransmissionRecord, raw: Float, after: float) -> float:
    quiet = found.raw[1 : int(np.searchsorted(found.t, found.start - 0.5 * found.interval))]
    return central_period(found.t, raw, found.sent, found.length, after, found.sampled, quiet)


def _check_length(found: TransmissionRecord, after: float) -> None:
    count = int(np.sum(found.t >= after))
    if count < _FEWEST_AFTER:
        raise PulseError(
            f"only {count} samples follow what was sent, at least {_FEWEST_AFTER} are needed: "
            "record longer, or look whether --input is the transmitter's column"
        )
