"""A finding: what is wrong with a record, where, by how much, and what was done about it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

CURED, WIDENED, TAKEN_OUT, REFUSED, TOLD = "cured", "widened", "taken out", "refused", "told"
DONE = (CURED, WIDENED, TAKEN_OUT, REFUSED, TOLD)


@dataclass(frozen=True)
class Finding:
    """One thing that is not well with a record.

    Attributes:
        what: the fault, in one or two words.
        where: channels or rows.
        size: how much of it, with its unit.
        done: "cured", "widened" (error bars hold it), "taken out" (channel or samples), "refused",
            or "told" (nothing was done).
        said: one sentence for a note, without its full stop.
    """

    what: str
    where: str
    size: str
    done: str
    said: str

    def row(self) -> dict[str, Any]:
        """Plain, for JSON."""
        return asdict(self)


def left_out(findings: Iterable[Finding]) -> list[str]:
    """What was taken out of a record, in a sentence each."""
    return [finding.said for finding in findings if finding.done == TAKEN_OUT]


def places(
    x: NDArray[Any], which: Iterable[Any], labels: tuple[str, ...] = (), most: int = 6
) -> str:
    """Where receivers stand: "x = 0.02, 0.03 m"; their names where positions are unknown.

    Args:
        x: positions of all, m.
        which: mask or numbers of those meant.
        labels: names of all.
        most: how many are listed.
    """
    chosen = np.arange(len(x))[np.asarray(which)].ravel()
    if len(chosen) == len(x) and len(x) > 2:
        return f"all {len(x)} receivers"
    more = ", …" if len(chosen) > most else ""
    if np.isfinite(x[chosen]).all():
        return "x = " + ", ".join(f"{p:g}" for p in x[chosen[:most]]) + more + " m"
    return ", ".join(labels[j] for j in chosen[:most]) + more


def beside_peak(part: float) -> str:
    """A size beside the signal's peak, in words: "3 % of the peak", "25 times the peak"."""
    return f"{100 * part:.3g} % of the peak" if part < 2 else f"{part:,.0f} times the peak"
