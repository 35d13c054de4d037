"""All that is looked for in a record before anything is read off it, in the order it must be."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.content import RecordError, UnitsError
from wavesim.records.faults import quantisation
from wavesim.records.faults.baseline import without_baseline
from wavesim.records.faults.channels import Mended, misfits
from wavesim.records.faults.clipping import clipped, tell_processed, without_stuck
from wavesim.records.faults.dropouts import without_bursts
from wavesim.records.faults.duplicates import clocks, duplicates
from wavesim.records.faults.fill_values import unwrapped, without_fill, without_spikes
from wavesim.records.faults.filled_in import without_filled_in
from wavesim.records.faults.filtered import check_unfiltered
from wavesim.records.faults.finding import TAKEN_OUT, TOLD, WIDENED, Finding, places
from wavesim.records.faults.frame_times import check_clock, check_goes_on, held_alone, once_each
from wavesim.records.faults.hum import without_early_hum
from wavesim.records.faults.interleaved import one_converter
from wavesim.records.faults.late_in_turn import check_none_late_in_turn
from wavesim.records.faults.lines import without_lines
from wavesim.records.faults.moveout import (
    arrivals,
    begun,
    comes_round,
    of_no_wave,
    source_within,
    speed,
)
from wavesim.records.faults.neighbours import unlike_neighbours
from wavesim.records.faults.order import check_order
from wavesim.records.faults.polarity import turned_round
from wavesim.records.faults.quiet import Rest, beside_mutes, rest
from wavesim.records.faults.recovery import without_recovery
from wavesim.records.faults.ring_misfits import ring_misfits
from wavesim.records.faults.undersampling import tell_undersampled

Float = NDArray[Any]
Mask = NDArray[np.bool_]
# Beside noise of this part of the spectrum's highest no two samples are alike by chance.
_NOISY = 1e-5
# Signals are muted into the wave where beside the mute they are this part of their peak.
_MUTED_INTO = 0.03
# Two receivers that stand in each other's place can be put back.
_EXCHANGED = 2


def samples(
    values: Float, t: Float, x: Float, labels: tuple[str, ...], ring: bool, found: list[Finding]
) -> tuple[Float, Float, float, Float, Mask, Mask]:
    """Look at samples as they were recorded: codes, spikes, repeats, flat tops, the least step,
    what a supply or a trigger adds; steady tones round a ring are waves.

    Returns:
        Values, shape (C, nt, nx), NaN where a sample is missing, and their times; for how many
        frames each sample was held, of which one is left; and of receivers, shape (nx,): the least
        step, whether they have flat tops, and whether they hold another's samples, or the times.
    """
    values, t, held = once_each(values, t, found)
    slower = held_alone(values, x, labels, found) if not ring else np.zeros(len(x), bool)
    values = without_fill(unwrapped(values, found), t, x, labels, found)
    values = without_bursts(values, t, x, labels, found)
    quantum = quantisation.quanta(values)
    # A gap is as broad in frequency as noise.
    whole = bool(np.isfinite(values).all())
    flat, part = clipped(values, quantum, whole and _noisy(values, _NOISY))
    flat &= ~slower
    if flat.any():
        where = places(x, flat, labels)
        found.append(Finding("clipped", where, f"up to {100 * part.max():.2g} % of samples", TOLD,
                             f"flat tops at {where}"))  # fmt: skip
    values = one_converter(values, x, labels, found)
    values = without_recovery(values, t, x, labels, quantum, found)
    for component in values if not ring else ():
        without_lines(component, t, x, labels, found)
    if _noisy(values):
        tell_processed(values, flat, quantum, found)
        for component in values if not slower.any() and held == 1 else ():
            check_unfiltered(component)
    values = without_stuck(values, t, x, labels, quantum, found)
    values = without_filled_in(values, t, x, labels, found)
    values = without_spikes(values, t, x, labels, flat, found)
    quantisation.tell(quantum, values, x, labels, found)
    hands = clocks(values)
    if hands.any():
        where = places(x, hands, labels)
        found.append(Finding("clock", where, f"{int(hands.sum())} channels", TAKEN_OUT,
                             f"clocks, not receivers: left out ({where})"))  # fmt: skip
    spare = hands | slower | duplicates(values, x, _noisy(values), found, labels)
    return values, t, held, quantum, flat, spare


def _noisy(values: Float, least: float = 1e-7) -> bool:
    """Whether channels hold noise: more than rounding at the highest frequencies."""
    some = np.nan_to_num(values[0, :, :: max(1, values.shape[2] // 16)])
    hat = np.abs(np.fft.rfft(some * np.hanning(len(some))[:, None], axis=0))
    top = np.median(hat[-max(4, len(hat) // 10) : -1], axis=0)
    return bool(np.median(top / np.maximum(hat.max(axis=0), 1e-300)) > least)


def levels(
    values: Float,
    t: Float,
    x: Float,
    labels: tuple[str, ...],
    quantum: Float,
    ring: bool,
    found: list[Finding],
) -> tuple[Float, list[Rest]]:
    """Offset, drift and hum taken out; where each channel is at rest.

    Waves round a ring are steady tones, as a hum is, which all hear alike there: at k = 0.
    """
    resting = []
    for c in range(len(values)):
        if not ring:
            values[c] = without_early_hum(values[c], t, x, labels, found)
        own = rest(values[c], quantum)
        before = len(found)
        values[c] = without_baseline(values[c], t, x, labels, quantum, own, found)
        if len(found) > before:
            own = rest(values[c], quantum)
        resting.append(own)
    return values, resting


def together(
    values: Float,
    missing: Mask,
    t: Float,
    x: Float,
    labels: tuple[str, ...],
    quantum: Float,
    unsure: Mask,
    ring: bool,
    lost: Mask,
    quiet_from: float,
    even: bool,
    as_recorded: bool,
    found: list[Finding],
) -> tuple[Mended, Mask, Mask, float | None]:
    """Channels beside each other: which do not fit, which have begun, where a source stands.

    Args:
        values: shape (C, nt, nx), without offset; not finite where a sample is missing.
        missing: frames that are, shape (nt,).
        t, x, labels: times, positions and names of the receivers.
        quantum: least step of each, shape (nx,).
        unsure: receivers whose size says nothing.
        ring: whether they go round a ring.
        lost: receivers round it that are bad, shape (nx,).
        quiet_from: time from which on no source acts, s.
        even: whether the receivers are evenly spaced.
        as_recorded: whether those along a line are taken as they are.
        found: findings, added to.

    Returns:
        What to do to the channels; those round a ring that do not fit; receivers at which the
        record begins inside the signal; the place of a source among them, m.
    """
    nx = values.shape[2]
    values = _filled(values, missing)
    strongest = int(np.argmax(np.abs(values).max(axis=(1, 2))))
    if not missing.any() and not as_recorded:
        check_goes_on(values[strongest], t)
        check_clock(values[strongest])
    own = rest(values[strongest], quantum)
    times = arrivals(values[strongest], t, own)
    line = not ring and np.isfinite(x).all()
    mended = Mended(np.arange(nx), np.ones(nx), np.zeros(nx, bool))
    if line and not as_recorded:
        check_none_late_in_turn(values[strongest], t, x, labels, own)
        check_order(values[strongest], t, x, own, times, mended, _EXCHANGED + 1)
    odd = np.zeros(nx, bool)
    seam = not lost[[0, -1]].any()
    if ring and seam and comes_round(values[strongest, t >= quiet_from]) is False:
        raise RecordError(
            "ring: the last receiver and the first differ far more than any other neighbours, so "
            "that the receivers do not go all round one: leave out --ring, or give those missing"
        )
    if ring:
        mended, odd = ring_misfits(values[:, t >= quiet_from], lost, x, labels, found)
    elif len(values) == 1 and not as_recorded:
        turned = turned_round(values[0], t, x, labels, own, found).factor
        mended = misfits(values[0] * turned, t, x, labels, own, unsure, found)
        mended.factor *= turned[mended.order]
        if not mended.out.any():
            right = values[0][:, mended.order] * mended.factor
            more = unlike_neighbours(right, x, labels, unsure, found)
            mended = Mended(mended.order, mended.factor * more.factor, more.out)
    if line and not as_recorded:
        check_order(values[strongest], t, x, own, times, mended, _EXCHANGED)
    if nx == values.shape[1] and np.isfinite(x).all():
        found.append(
            Finding("square", "whole array", f"{nx} by {nx}", TOLD,
                    "as many times as receivers: taken as times down, receivers across; transpose "
                    "the array if it is the other way round")
        )  # fmt: skip
    if not ring:
        tell_undersampled(values[strongest], own.noise, found)
    within = begun(values[strongest], own)
    place = None
    if line and nx > 2:
        place = source_within(x, times[0])
        v = speed(x, times[0])
        if place is None and (why := of_no_wave(v, v)):
            raise UnitsError(why)
    if not ring and even and place is None and comes_round(values[strongest]):
        found.append(
            Finding("comes round", "all receivers", f"{nx} receivers", TOLD,
                    "the last receiver and the first are neighbours by what they show, as round a "
                    "ring: if they are, say so with --ring, for nothing else is read right then")
        )  # fmt: skip
    if within.any() and not ring:
        found.append(
            Finding("begins inside", places(x, within, labels),
                    f"{int(within.sum())} of {nx} receivers", TOLD,
                    "the record begins inside the signal at "
                    f"{int(within.sum())} of {nx} receivers ({places(x, within, labels)})")
        )  # fmt: skip
    if not ring:
        peak = np.abs(values[strongest]).max(axis=0)
        muted = beside_mutes(values[strongest], quantum) > _MUTED_INTO * peak
        where, size = places(x, muted, labels), f"{int(muted.sum())} of {nx} receivers"
        said = f"signals are muted into the wave at {size} ({where})"
        found += [Finding("muted", where, size, WIDENED, said)] * bool(muted.any())
    return mended, odd, within, place


def _filled(values: Float, missing: Mask) -> Float:
    """Values with straight lines over what is missing, to look at."""
    gone = ~np.isfinite(values) | missing[:, None]
    if not gone.any():
        return values
    filled = values.copy()
    frames = np.arange(values.shape[1])
    for c, j in zip(*np.nonzero(gone.any(axis=1)), strict=True):
        there = ~gone[c, :, j]
        if there.any():
            filled[c, :, j] = np.interp(frames, frames[there], values[c, there, j])
        else:
            filled[c, :, j] = 0.0
    return filled


__all__ = ["levels", "samples", "together"]
