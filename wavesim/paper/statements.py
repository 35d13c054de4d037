"""The paper's claims split into statements, each with its criterion and measured numbers.

Where the paper names no a (its Figures 4 and 5) statements are judged at a = 0, where the closures
are the same, and at a = 0.5.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from wavesim.material.granular_equations import ROTATION
from wavesim.material.medium import Medium
from wavesim.planewave.band_edges import full_gaps
from wavesim.planewave.dispersion_relation import (
    block_frequencies,
    group_velocity,
    long_wave_speed,
)
from wavesim.planewave.eigenproblem import Float
from wavesim.planewave.gap_map import family_gaps

A_VALUES = np.linspace(0.0, 1.0, 21)
ETA_VALUES = np.linspace(0.0, 1.0, 61) ** 2  # denser near 0, where edges go as √η
K_BAR = np.linspace(0.0, 1.0, 201)


@dataclass(frozen=True)
class Study:
    """What the claims are judged on: branches over k̄ and a, gap edges over a and over η."""

    closure: str

    def medium(self, a: float) -> Medium:
        """Table 1 with this a and closure."""
        return Medium(anisotropy=a, closure=self.closure)

    @cached_property
    def branch(self) -> dict[str, Float]:
        """ω̄ of each branch, shape (a, k̄), without the second of the transverse sectors."""
        found: dict[str, list[Float]] = {}
        for a in A_VALUES:
            medium = self.medium(float(a))
            k = K_BAR * 2 * math.pi / medium.length_scale
            for block in ROTATION.blocks:
                if block.sector != "transverse3":
                    omega = block_frequencies(medium, block, k) * medium.time_scale
                    for name, values in zip(block.branches, omega.T, strict=True):
                        found.setdefault(name, []).append(values)
        return {name: np.array(values) for name, values in found.items()}

    @cached_property
    def over_a(self) -> tuple[dict[str, Float], dict[str, Float]]:
        """Lower and upper gap edges, ω̄, over A_VALUES at η = 0.5."""
        return self._edges(Medium(anisotropy=A_VALUES, closure=self.closure))

    def over_eta(self, a: float) -> tuple[dict[str, Float], dict[str, Float]]:
        """Lower and upper gap edges, ω̄, over ETA_VALUES."""
        return self._edges(Medium(anisotropy=a, stiffness_ratio=ETA_VALUES, closure=self.closure))

    def _edges(self, family: Medium) -> tuple[dict[str, Float], dict[str, Float]]:
        lower, upper = family_gaps(family)
        scale = family.time_scale
        return (
            {name: edge * scale for name, edge in lower.items()},
            {name: edge * scale for name, edge in upper.items()},
        )


@dataclass(frozen=True)
class Statement:
    """One statement of a claim, judged for one closure.

    Attributes:
        text: the statement with its criterion.
        values: measured numbers by name.
        holds: whether the criterion is met.
    """

    text: str
    values: dict[str, float]
    holds: bool


Found = tuple[str, dict[str, float], Any]
"""A statement's text, its values, and whether it holds."""


def _rises(values: Float) -> bool:
    return bool((np.diff(values, axis=0) > -1e-12).all())


def _falls(values: Float) -> bool:
    return _rises(-values)


def _at(k_bar: float) -> int:
    return int(np.argmin(np.abs(K_BAR - k_bar)))


def _change(values: Float) -> Float:
    """Relative change from a = 0 to a = 1 at each k̄ (0 where ω = 0)."""
    start = np.where(values[0] == 0, 1.0, values[0])
    return (values[-1] - values[0]) / start


def _ends(values: Float) -> dict[str, float]:
    """Values at a = 0 and a = 1."""
    return {"a = 0": float(values[0]), "a = 1": float(values[-1])}


def _course(values: Float) -> dict[str, float]:
    """Values at the ends of A_VALUES, the highest, and where that is."""
    peak = int(np.argmax(values))
    highest = {"highest": float(values[peak]), "highest at a": float(A_VALUES[peak])}
    return {**_ends(values), **highest}


def twelve_waves(study: Study) -> Iterator[Found]:
    """Claim 1."""
    medium = study.medium(0.5)
    k = K_BAR[1:] * 2 * math.pi / medium.length_scale
    waves = [w for block in ROTATION.blocks for w in block_frequencies(medium, block, k).T]
    distinct: list[Float] = []
    for wave in waves:
        if not any(np.allclose(wave, other, rtol=1e-9, atol=0) for other in distinct):
            distinct.append(wave)
    counts = {"waves": float(len(waves)), "relations": float(len(distinct))}
    yield (
        "twelve waves, eight distinct relations (a = 0.5)",
        counts,
        len(waves) == 12 and len(distinct) == 8,
    )


def acoustic_longitudinal(study: Study) -> Iterator[Found]:
    """Claim 2."""
    la = study.branch["LA"]
    medium = study.medium(0.0)
    end = float(study.over_a[0]["RLB1"][0])
    reached = la[0, -1] / end
    change = la[-1] - la[0]
    yield (
        "LA rises fast, then to an asymptote: at k̄ = 1 within 3 % of it, a = 0",
        {
            "ω̄(k̄ = 1)": float(la[0, -1]),
            "asymptote": end,
            "long-wave speed, m/s": long_wave_speed(medium, "longitudinal"),
        },
        _rises(la[0]) and reached > 0.97,
    )
    yield (
        "a matters little for k̄ < 0.1: from a = 0 to 1 ω̄ changes by less than half of what it "
        "does at k̄ = 1 (relative to ω̄ it changes as much)",
        {
            "change of ω̄, k̄ = 0.05": float(change[_at(0.05)]),
            "k̄ = 0.1": float(change[_at(0.1)]),
            "k̄ = 1": float(change[-1]),
            "relative, k̄ = 0.05": float(_change(la)[_at(0.05)]),
            "relative, k̄ = 1": float(_change(la)[-1]),
        },
        change[: _at(0.1) + 1].max() < 0.5 * change[-1],
    )
    yield ("LA at k̄ = 1 rises with a all the way to a = 1", _course(la[:, -1]), _rises(la[:, -1]))


def optical_longitudinal(study: Study) -> Iterator[Found]:
    """Claim 3."""
    upper, lower = study.branch["LO2"], study.branch["LO1"]
    medium = study.medium(0.0)
    k = np.array([0.95, 1.0]) * 2 * math.pi / medium.length_scale
    speed = group_velocity(medium, "longitudinal", k)[:, 2]
    change, end = _change(lower), float(study.over_a[0]["RLB2"][0])
    yield (
        "LO(B̄) becomes about linear: group velocity changes by less than 1 % at k̄ = 1, a = 0",
        {"∂ω/∂k at k̄ = 1, m/s": float(speed[1])},
        abs(speed[1] / speed[0] - 1) < 0.01,
    )
    yield (
        "LO(B̄) rises with a at every k̄",
        {"change to a = 1, k̄ = 0": float(_change(upper)[0]), "at k̄ = 1": float(_change(upper)[-1])},
        _rises(upper),
    )
    yield (
        "LO(B_D) tends to an asymptote: at k̄ = 1 within 1 % of it, a = 0",
        {"ω̄(k̄ = 1)": float(lower[0, -1]), "asymptote": end},
        abs(lower[0, -1] / end - 1) < 0.01,
    )
    yield (
        "LO(B_D) is lower at a = 1 than at a = 0 at k̄ = 1, and rises with a at first at k̄ = 0",
        {
            "change to a = 1, k̄ = 1": float(change[-1]),
            "change to a = 0.1, k̄ = 0": float(lower[2, 0] / lower[0, 0] - 1),
        },
        change[-1] < 0 and lower[2, 0] > lower[0, 0],
    )


def transverse(study: Study) -> Iterator[Found]:
    """Claim 4."""
    b = study.branch
    flat = float(np.ptp(b["TO1"], axis=1).max() / b["TO1"].min())
    acoustic = (float(_change(b["TA"])[-1]), float(_change(b["LA"])[-1]))
    optical = (float(_change(b["TO2"])[0]), float(_change(b["LO2"])[0]))
    below = bool((b["TA"] <= b["LA"]).all() and (b["TO2"] < b["LO2"]).all())
    yield (
        "TA lies below LA, and TO(B(12)) below LO(B̄), at every k̄ and a",
        {"TA at k̄ = 1": float(b["TA"][0, -1]), "LA at k̄ = 1": float(b["LA"][0, -1])},
        below,
    )
    yield (
        "TA (at k̄ = 1) and TO(B(12)) (at k̄ = 0) are less sensitive to a than LA and LO(B̄)",
        {"TA": acoustic[0], "LA": acoustic[1], "TO(B(12))": optical[0], "LO(B̄)": optical[1]},
        abs(acoustic[0]) < abs(acoustic[1]) and abs(optical[0]) < abs(optical[1]),
    )
    yield (
        "TO(B[12]) is nearly flat: it rises by less than 15 % over k̄",
        {"most": flat},
        flat < 0.15,
    )
    yield (
        "TO(B[12]) rises with a at every k̄",
        {"ω̄(0), a = 0": float(b["TO1"][0, 0]), "ω̄(0), a = 1": float(b["TO1"][-1, 0])},
        _rises(b["TO1"]),
    )


def shear(study: Study) -> Iterator[Found]:
    """Claim 5."""
    waves = {name: study.branch[f"TSO{name}"] for name in ("[23]", "(23)", "(22-33)")}
    spread = max(float((np.ptp(w, axis=1) / w.min(axis=1)).max()) for w in waves.values())
    ends = {
        f"B{name}, a = {a}": float(wave[i, 0])
        for name, wave in waves.items()
        for a, i in ((0, 0), (1, -1))
    }
    yield ("TSO do not depend on k̄ (to 1e-6)", {"most": spread}, spread < 1e-6)
    yield ("all three fall as a grows", ends, all(_falls(w) for w in waves.values()))


def gaps(study: Study) -> Iterator[Found]:
    """Claim 6."""
    lower, upper = study.over_a
    for a in (0.0, 0.5):
        i = int(np.argmin(np.abs(A_VALUES - a)))
        width = {name: float(upper[name][i] - lower[name][i]) for name in lower}
        medium = study.medium(a)
        free = [edge * float(medium.time_scale) for pair in full_gaps(medium) for edge in pair]
        edges = {f"edge {n + 1}": edge for n, edge in enumerate(free)}
        widths = {f"width {name}": value for name, value in width.items() if name != "RSB"}
        wider = width["RLB1"] > width["RLB2"] and width["RTB1"] > width["RTB2"]
        yield (f"RLB1 is wider than RLB2, RTB1 than RTB2 (a = {a:g})", widths, wider)
        yield (f"a range without any wave exists (a = {a:g})", edges, bool(free))


def stiffness_ratio(study: Study) -> Iterator[Found]:
    """Claim 7."""
    for a in (0.0, 0.5):
        lower, upper = study.over_eta(a)
        width = {name: upper[name] - lower[name] for name in lower}
        middle = {name: 0.5 * (upper[name] + lower[name]) for name in lower}
        for name in ("RLB1", "RTB1"):
            yield (
                f"{name} widens and moves up from η = 0 to 1 (a = {a:g})",
                {"width at 0": float(width[name][0]), "width at 1": float(width[name][-1])},
                _rises(width[name]) and _rises(middle[name]),
            )
        yield (
            f"RTB1 has no width at η = 0, where the lower TO starts at ω = 0 (a = {a:g})",
            {"width": float(width["RTB1"][0]), "cutoff": float(upper["RTB1"][0])},
            width["RTB1"][0] < 1e-6 and upper["RTB1"][0] < 1e-6,
        )
        for name in ("RLB2", "RTB2", "RSB"):
            yield (
                f"{name} shrinks to 0 (a = {a:g})",
                {"width at 0": float(width[name][0]), "width at 1": float(width[name][-1])},
                _falls(width[name]) and bool(width[name][-1] < 1e-6),
            )


def anisotropy(study: Study) -> Iterator[Found]:
    """Claim 8."""
    lower, upper = study.over_a
    width = {name: upper[name] - lower[name] for name in lower}
    top = upper["RLB1"]
    peak = int(np.argmax(top))
    across = ("RTB1", "RTB2")
    edges = {
        f"{name} {side}, {key}": value
        for name in across
        for side, edge in (("lower", lower), ("upper", upper))
        for key, value in _ends(edge[name]).items()
    }
    widths = {f"{n}, {key}": value for n in across for key, value in _ends(width[n]).items()}
    yield (
        "lower edge of RLB1 rises all the way to a = 1",
        _course(lower["RLB1"]),
        _rises(lower["RLB1"]),
    )
    yield (
        "upper edge of RLB1 rises slightly, then falls",
        _course(top),
        0 < peak < len(top) - 1 and _rises(top[: peak + 1]) and _falls(top[peak:]),
    )
    yield ("RLB1 closes at a = 1 (width < 0.01)", _ends(width["RLB1"]), width["RLB1"][-1] < 0.01)
    yield ("RLB2 widens", _ends(width["RLB2"]), _rises(width["RLB2"]))
    yield (
        "both edges of RTB1 and of RTB2 move up",
        edges,
        all(_rises(edge[name]) for edge in (lower, upper) for name in across),
    )
    yield (
        "the widths of RTB1 and RTB2 change little (by less than 0.05)",
        widths,
        all(abs(width[name][-1] - width[name][0]) < 0.05 for name in across),
    )
    yield (
        "RSB moves down",
        {f"lower, {key}": value for key, value in _ends(lower["RSB"]).items()}
        | {f"upper, {key}": value for key, value in _ends(upper["RSB"]).items()},
        _falls(lower["RSB"]) and _falls(upper["RSB"]),
    )
