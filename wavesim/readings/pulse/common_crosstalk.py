"""Crosstalk that the records of a series have in common, as the wave moves from one to the next.

Whatever its form, and however long it rings, it comes at the same time after what is sent in every
state, and the wave does not. At each time it is the median over the records, at the size that each
has of it, as long as most of them agree there: where waves have come to half of them it is unknown.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.readings.pulse.central_band import band_about
from wavesim.readings.pulse.first_break import envelope
from wavesim.readings.pulse.series import in_order
from wavesim.readings.pulse.transmission_record import TransmissionRecord, blanked
from wavesim.readings.pulse.wave_packets import Packet
from wavesim.records.windows import moving_mean

Float = NDArray[Any]

# A median tells it of so many records at least, in which it is alike to this part of its power.
_FEWEST, _ALIKE = 5, 0.9
# It begins with what is sent, within so many periods, as long as it is told by; a record agrees
# where it leaves this part of it, in so many periods, and most do.
_BEGINS, _LEAVES, _AT_A_TIME, _MOST = 0.75, 0.3, 0.5, 0.6
# What rises in it by this factor is a wave that hardly moves.
_RISEN = 2.0
# This part of it, by which records differ, may be left, and is no wave of this part of the largest.
_LEFT, _WAVE = 0.15, 0.08
# No wave comes sooner than so many periods.
_SOONEST = 0.25
# A packet stands still that so many of the records have within this part of a period, and so soon
# after what was sent is over, in periods.
_HAVE, _STILL, _SOON = 0.7, 0.12, 2.0


def without_common(records: Sequence[TransmissionRecord]) -> list[TransmissionRecord] | None:
    """Records of a series without the crosstalk that they have in common; None where none is told.

    Args:
        records: of one set-up in different states.
    """
    hear = [i for i, one in enumerate(records) if one.crosstalk]
    if len(hear) < max(_FEWEST, _MOST * len(records)):
        return None
    period = float(np.median([one.period for one in records]))
    step = min(one.interval for one in records)
    after = np.arange(-period, min(float(one.t[-1]) - one.start for one in records), step)
    whole = [one.raw + one.crosstalk_taken for one in records]
    rows = np.array([
        np.interp(after, one.t - one.start, band_about(u, one.interval, period), left=0.0)
        for one, u in zip(records, whole, strict=True)
    ])  # fmt: skip
    begins = (after > 0) & (after < _BEGINS * period)
    size = np.linalg.norm(rows[:, begins], axis=1)
    common, alike = np.zeros(len(after)), np.zeros(len(records), bool)
    alike[hear] = True
    for _ in range(3):
        sign = np.sign(rows[:, begins] @ rows[hear[0], begins])
        scale = np.where(size > 0, size * sign, 1.0)
        common = np.median(rows[alike] / scale[alike, None], axis=0)
        form = common[begins] / np.linalg.norm(common[begins])
        size = np.abs(rows[:, begins] @ form)
        alike = size**2 > _ALIKE * np.sum(rows[:, begins] ** 2, axis=1)
        if alike.sum() < max(_FEWEST, _MOST * len(records)):
            return None
    each = rows @ np.where(begins, common, 0.0) / float(np.sum(common[begins] ** 2))
    width = max(3, int(_AT_A_TIME * period / step))
    left = np.array([moving_mean(u**2, width) for u in rows - each[:, None] * common])
    there = moving_mean(common**2, width)
    noise = np.array([np.nan_to_num(one.noise_in_band) for one in records])
    agree = left < np.maximum(_LEAVES**2 * np.outer(each**2, there), 4 * noise[:, None] ** 2)
    told = np.mean(agree[alike], axis=0) > _MOST
    outline = envelope(common)
    lowest = np.minimum.accumulate(np.where(after > _BEGINS * period, outline, np.inf))
    ends = (after > _BEGINS * period) & (~told | (outline > _RISEN * lowest))
    stop = float(after[int(np.argmax(ends))]) if ends.any() else float(after[-1])
    weight = np.clip((stop - after) / (width * step), 0.0, 1.0) * (after >= 0)
    result = []
    for one, u, size_of, own in zip(records, whole, each.tolist(), alike.tolist(), strict=True):
        if not own:
            result.append(one)
            continue
        # It is taken as it is in the band; what lies beyond was no crosstalk of the wave's.
        taken = np.interp(one.t - one.start, after, size_of * common * weight, left=0.0, right=0.0)
        raw = u - taken
        rest = envelope(band_about(raw, one.interval, period))
        first = int(np.searchsorted(one.t, one.start + _SOONEST * period))
        may = np.abs(size_of) * outline * _LEFT > _WAVE * float(rest[first:].max())
        over = float(after[np.flatnonzero(may)[-1]]) if may.any() else 0.0
        blank = one.start + max(_SOONEST * period, over)
        if not (one.unended or one.risen or one.crosstalk_taken.any()):
            blank = min(blank, one.blank)  # it has died away there
        known = replace(
            one, raw=raw, crosstalk_taken=taken, unended=False, risen=False,
            crosstalk=float(np.abs(taken).max()),
        )  # fmt: skip
        result.append(blanked(known, min(blank, max(one.blank, one.start + stop))))
    return result


def without_still(
    heard: Sequence[list[Packet]],
    records: Sequence[TransmissionRecord],
    order: Sequence[int],
) -> list[list[Packet]]:
    """Packets of a series without those that stand still soon after what was sent, as what is left
    of crosstalk does, and its edges' own; all of them, but where the largest others move in order.

    Args:
        heard, records: packets, and the records.
        order: indices of the records, neighbours in state next to each other.
    """
    period = float(np.median([one.period for one in records]))
    tops = [np.array([packet.top for packet in own]) for own in heard]
    least = _HAVE * sum(len(own) > 0 for own in tops)

    def stands(packet: Packet, record: TransmissionRecord) -> bool:
        near = sum(bool((np.abs(own - packet.top) < _STILL * period).any()) for own in tops)
        return near >= least and packet.top < record.length + _SOON * period

    rest = [[q for q in own if not stands(q, r)] for own, r in zip(heard, records, strict=True)]
    largest = [max(rest[i], key=lambda q: q.size).top for i in order if rest[i]]
    moves = len(largest) >= max(_FEWEST, least) and in_order(np.array(largest), period)
    return rest if moves else list(heard)
