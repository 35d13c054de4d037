"""Crosstalk of any record, as findings: a pulse test leaves it out, other readings take it for
waves."""

from __future__ import annotations

import contextlib

from wavesim.readings.pulse.array_crosstalk import without_what_all_hear_at_once
from wavesim.readings.pulse.echo_gate import common_period
from wavesim.readings.pulse.signals import PulseError, pulse_record
from wavesim.readings.pulse.transmission_record import transmission_record
from wavesim.records.faults.finding import TOLD, Finding, beside_peak
from wavesim.records.record import Record

# Receivers whose crosstalk is looked for one by one.
_LOOKED_AT = 16


def crosstalk_findings(record: Record) -> list[Finding]:
    """Crosstalk of a record, receiver by receiver where what was sent is known, else of all at
    once."""
    own = dict(zip(record.labels, record.values[0].T, strict=False))
    found = []
    if record.input is not None:
        for label, u in list(own.items())[:_LOOKED_AT]:
            with contextlib.suppress(PulseError):
                one = transmission_record(record.t, u, record.input, label)
                size, until = beside_peak(one.crosstalk), one.blank - one.start
                said = f"crosstalk up to {until:.3g} s after what was sent begins ({label})"
                if one.crosstalk:
                    found.append(Finding("crosstalk", label, size, TOLD, said))
        return found
    notes: list[str] = []
    try:
        looked_at = pulse_record(record.t, own, dict(zip(own, record.x.tolist(), strict=False)))
        without_what_all_hear_at_once(looked_at, own, common_period(looked_at), notes)
    except PulseError as error:
        notes = [str(error)] if "hear the same" in str(error) else []
    return [Finding("crosstalk", "all receivers", "at once", TOLD, said) for said in notes]
