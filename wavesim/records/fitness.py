"""What a method needs of a record: channels that it can't use left out, or the record refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wavesim.records.content import RecordError
from wavesim.records.faults.clipping import NORMALISED
from wavesim.records.faults.finding import CURED, TAKEN_OUT, Finding, places
from wavesim.records.faults.moveout import BEGINS
from wavesim.records.faults.ring_misfits import gains
from wavesim.records.faults.ring_waves import missing_between_ends, waves_appear
from wavesim.records.faults.unfit_receivers import PART
from wavesim.records.record import FEWEST_FRAMES, Record

# A record that is at rest at its beginning, and not later, was driven within.
_AT_REST = 0.03
_BEGINNING = 3
# Missing frames are bridged if so few, or if all about them is below this many times the noise, or
# this part of the peak.
_BRIDGED = 2
_QUIET, _QUIET_PART = 6.0, 1e-4
# More missing frames than this part are no small gap of a pulse test.
_SMALL_GAP = 0.01
# A line's waves are told apart by so many receivers.
_FEWEST_ALONG = 5
# So many frames at the end that are all alike are padding.
_PADDED = 4


def for_k_at_frequency(record: Record) -> Record:
    """The receivers that are whole, linear and at rest at the beginning.

    Raises:
        RecordError: fewer than two are, or a source stands among them that is not named.
    """
    record = _filled(record.without_gaps())
    if not record.ring and (why := levelled(record)):
        raise RecordError(f"{why}; give them as recorded, or take wavesim dispersion, which "
                          "reads phases alone")  # fmt: skip
    if record.source_seen is not None:
        raise RecordError(
            f"the signal comes first to receivers near x = {record.source_seen:.3g} m and later to "
            "those on either side: a source stands among them; name it with --source "
            f"{record.source_seen:.3g}"
        )
    if len(record.begun) and record.begun.any() and not record.ring:
        muted = any(finding.what == "muted" for finding in record.findings)
        what = "muted" if muted else "begins inside"
        remedy = "give them as they were recorded" if muted else (
            "begin it before the source does (a pre-trigger), or give receivers farther away"
        )  # fmt: skip
        record = _without(record, record.begun, what, BEGINS[what], remedy)
    return unclipped(record)


def levelled(record: Record) -> str:
    """Why amplitudes along a record tell nothing, "" where they do."""
    return next((finding.said for finding in record.findings if finding.what == NORMALISED), "")


def for_waves_along_line(record: Record) -> Record:
    """A line of receivers with small gaps bridged.

    Raises:
        RecordError: frames are missing all the same.
    """
    return _filled(record.without_gaps())


def for_pulse_test(record: Record) -> Record:
    """A pulse test without padding at its end, and without receivers that have large gaps.

    Raises:
        RecordError: more than a small gap is missing.
    """
    if len(record.missing) and record.missing.sum() > _SMALL_GAP * len(record.missing):
        record = record.without_gaps()
    missing = record.missing
    if len(missing) and missing.sum() > _SMALL_GAP * len(missing):
        raise RecordError(
            f"{missing.sum()} of {len(missing)} frames are missing; a pulse test needs them: "
            "record again without the gap"
        )
    return record if record.input is not None else live(record)


def for_frequency_at_k(record: Record, harmonic: bool = True) -> Record:
    """The record, if it can be used for ω at given k.

    Args:
        record: the record.
        harmonic: whether every frame must be free of sources.

    Raises:
        RecordError: it holds a source's time, or flat tops.
    """
    if record.ring:
        record = _read_from_others(record)
    else:
        whole, record = record, unclipped(record, _FEWEST_ALONG)
        if harmonic and whole.even and not record.even:
            where = places(whole.x, whole.clipped, whole.labels)
            raise RecordError(
                f"flat tops at {where}: without these the receivers are not evenly spaced, as "
                "harmonic inversion needs them; turn the gain down, or take --method auto"
            )
    still = record.driven and at_rest_first(record)
    # What enters a stretch at its ends is refused for that, or taken by the FFT.
    if still and (record.ring or (harmonic and not _entered(record))):
        raise RecordError(
            "all receivers are at rest at the record's beginning and move later, so that a source "
            "acts within it: name the time from which on none does with --quiet-from (s)"
        )
    if record.ring and record.leak is None:  # else its receivers are known
        _check_whole(record)
        _check_goes_on(record)
    return evened(record)


def _check_whole(ring: Record) -> None:
    """Raise :class:`RecordError` where receivers are missing between the last and the first."""
    u = ring.values[:, ring.t >= ring.quiet_from]
    strongest = u[int(np.argmax(np.abs(np.nan_to_num(u)).max(axis=(1, 2), initial=0.0)))]
    odd = ring.misfit if len(ring.misfit) else np.zeros(len(ring.x), bool)
    if not np.isfinite(strongest).all() or not (gone := missing_between_ends(strongest, odd)):
        return
    raise RecordError(
        f"ring: the waves close round it with {gone} more receiver{'s' * (gone > 1)} between the "
        "last and the first, and not without: give those missing, or leave out --ring"
    )


def _check_goes_on(ring: Record) -> None:
    """Raise :class:`RecordError` where waves appear within a record of a ring."""
    u = ring.values[:, ring.t >= ring.quiet_from]
    strongest = u[int(np.argmax(np.abs(np.nan_to_num(u)).max(axis=(1, 2), initial=0.0)))]
    if np.isfinite(strongest).all() and not ring.missing.any() and waves_appear(strongest):
        raise RecordError(
            "most of what moves round the ring at the end moves at frequencies that are not there "
            "at the beginning: the interval between frames changes within the record, or a source "
            "acts in it; take a part without that, or name the time from which on no source acts "
            "with --quiet-from (s)"
        )


def unclipped(record: Record, fewest: int = 2) -> Record:
    """Without the receivers with flat tops, unless they go round a ring.

    Raises:
        RecordError: fewer than so many remain, or than five where that is less than half: a few
            loud ones taken away, several waves that pass are no longer told apart by the rest.
    """
    if record.ring or not len(record.clipped) or not record.clipped.any():
        return record
    fewest = max(fewest, min(_FEWEST_ALONG, (len(record.x) + 1) // 2))
    return _without(
        record, record.clipped, "clipped", "flat tops", "turn the gain down and record again",
        fewest,
    )  # fmt: skip


def _read_from_others(ring: Record) -> Record:
    """A ring of which those with flat tops are read from the others."""
    flat = ring.clipped
    if not len(flat) or not flat.any():
        return ring
    where = places(ring.x, flat, ring.labels)
    if not len(ring.misfit) or (flat | ring.misfit).mean() > PART:
        raise RecordError(
            f"flat tops at {where}: the samples are cut off at the digitiser's range, which makes "
            "waves that are none; turn the gain down and record again"
        )
    said = f"flat tops, read from the others ({where})"
    told = Finding("clipped", where, f"{int(flat.sum())} of {len(flat)}", TAKEN_OUT, said)
    return replace(ring, misfit=ring.misfit | flat).with_finding(told)


def live(record: Record) -> Record:
    """Without the frames at its end in which nothing changes at any receiver: padding."""
    changing = (np.diff(record.values, axis=1) != 0).any(axis=(0, 2))
    if len(record.missing):
        changing |= record.missing[1:]
    changes = np.flatnonzero(changing)
    # The first frame of a padding is no signal either.
    last = int(changes[-1]) + 1 if len(changes) else len(record.t)
    if last >= len(record.t) - _PADDED or last < FEWEST_FRAMES:
        return record
    missing = record.missing[:last] if len(record.missing) else record.missing
    kept = replace(record, t=record.t[:last], values=record.values[:, :last], missing=missing)
    return replace(kept, whole=None if record.whole is None else record.whole[:, :last])


def evened(record: Record) -> Record:
    """A ring with the gains of its receivers made equal, where its waves show that they are not."""
    if record.leak is not None or (len(record.missing) and record.missing.any()):
        return record
    if not record.ring:
        return replace(record, leak=0.0)
    free = live(record.since(record.quiet_from)).values
    seen = [gains(component, record.misfit) for component in free]
    right = np.stack(
        [
            one.put_right(own) if one.any else own
            for one, own in zip(seen, record.values, strict=True)
        ]
    )
    kept = replace(record, values=right, leak=max(one.left for one in seen))
    told = []
    for what, off, scale, unit in (
        ("gains differ", [one.gain - 1 for one in seen], 100.0, " %"),
        ("places are off", [one.place for one in seen], record.spacing, " m"),
        ("clocks differ", [one.late for one in seen], record.interval, " s"),
    ):
        size = float(np.sqrt(np.mean(np.square(off))))
        if size:
            told.append(f"{what} by {scale * size:.2g}{unit}")
    if not told:
        return kept
    said = f"receivers' {', '.join(told)} (rms), as the ring's waves say: put right"
    return kept.with_finding(Finding("unequal receivers", "all receivers", told[0], CURED, said))


def at_rest_first(record: Record) -> bool:
    """Whether nothing moves at the beginning, at any receiver, beside what does later."""
    size = np.sqrt(np.mean(record.values**2, axis=2)).max(axis=0)
    if len(record.missing):
        size = size[~record.missing]
    return bool(size[:_BEGINNING].max() < _AT_REST * size.max())


def _filled(record: Record) -> Record:
    """Frames that are missing at all receivers filled: one or two, or where nothing moves."""
    if not len(record.missing) or not record.missing.any():
        return record
    gone = record.missing
    edges = np.flatnonzero(np.diff(np.concatenate([[0], gone.astype(int), [0]]))).reshape(-1, 2)
    size = np.abs(record.values).max()
    values, there = record.values.copy(), ~gone
    from scipy.interpolate import CubicSpline  # slow to import, and only a fault needs it

    spline = CubicSpline(record.t[there], values[:, there], axis=1)
    for start, stop in edges:
        inside = start >= 2 and stop <= len(gone) - 2
        about = values[:, max(0, 2 * start - stop - 2) : 2 * stop - start + 2]
        if inside and stop - start <= _BRIDGED:
            values[:, start:stop] = spline(record.t[start:stop])
        elif np.abs(about).max() > max(_QUIET * record.noise, _QUIET_PART * size):
            raise RecordError(
                f"{stop - start} frames are missing from t = {record.t[start]:.6g} s on, while the "
                "signal goes on: transforms in time need them all; fill them, leave out the "
                "receivers that lack them, or use the part before"
            )
    finding = Finding(
        "frames missing", f"from t = {record.t[edges[0, 0]]:.6g} s", f"{int(gone.sum())} frames",
        CURED, f"{int(gone.sum())} missing frames filled",
    )  # fmt: skip
    return replace(record, values=values, missing=np.zeros_like(gone)).with_finding(finding)


def _entered(record: Record) -> bool:
    """Whether waves are seen at the ends of a stretch that is at rest at first."""
    ends = record.values[..., [0, -1]] ** 2
    # Signals up to the Nyquist frequency look like noise, but not before they come.
    noise = min(record.noise, float(np.sqrt(np.mean(ends[:, :_BEGINNING]))))
    return float(np.sqrt(np.mean(ends))) > 2 * noise + 3e-3 * float(np.abs(record.values).max())


def _without(
    record: Record, which: np.ndarray, what: str, why: str, remedy: str, fewest: int = 2
) -> Record:
    where = places(record.x, which, record.labels)
    kept = int((~which).sum())
    if kept < fewest:
        raise RecordError(f"{why} at {where}: {remedy}; {fewest} receivers at least are needed")
    finding = Finding(
        what, where, f"{int(which.sum())} of {len(which)}", TAKEN_OUT,
        f"{why} at {where}: left out; {kept} receivers remain",
    )  # fmt: skip
    others = tuple(f for f in record.findings if f.what != what)
    notes = tuple(n for n in record.notes if n not in {f.said for f in record.findings} - {
        f.said for f in others})  # fmt: skip
    return replace(record, findings=others, notes=notes).receivers(~which).with_finding(finding)
