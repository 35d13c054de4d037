"""What a sweep varies: keys of a case file over ranges, as a grid or as a sample of its box."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.case.units import meant_by, unit_of

SAMPLERS = ("sobol", "lhs")
_FORM = "KEY=FROM:TO:N, such as medium.anisotropy=0:1:11"
# More members than this are taken for a slip of the pen, before any is made.
_MOST = 10**7

Float = NDArray[np.float64]
Region = tuple[slice, ...]


class SweepError(ValueError):
    """A sweep can't be made as it was asked for; the message says what to change."""


@dataclass(frozen=True)
class Axis:
    """A key of the case file and the range it takes.

    Attributes:
        key: as of ``--set``, such as "medium.anisotropy" or "layers.1.G_n_a".
        low, high: ends of the range, in the key's unit.
        count: values on a grid, evenly spaced, ends included; 0 where none was given.
    """

    key: str
    low: float
    high: float
    count: int = 0

    @property
    def unit(self) -> str:
        """SI, "1" for a number without one."""
        return _unit(self.key) or "1"


@dataclass(frozen=True)
class Variation:
    """The members of a sweep.

    Attributes:
        axes: the keys varied, one at least.
        values: shape (members, keys), in the order of ``shape``, the last dimension fastest.
        shape: members along each dimension: one dimension a key of a grid, one of a sample.
        sampler: "grid", "sobol" or "lhs".
        seed: of a sample.
    """

    axes: tuple[Axis, ...]
    values: Float
    shape: tuple[int, ...]
    sampler: str
    seed: int

    @property
    def keys(self) -> tuple[str, ...]:
        """Names of the keys."""
        return tuple(axis.key for axis in self.axes)

    @property
    def dimensions(self) -> tuple[str, ...]:
        """Names of the dimensions: the keys of a grid, "member" of a sample."""
        return self.keys if self.sampler == "grid" else ("member",)

    @property
    def count(self) -> int:
        """Number of members."""
        return len(self.values)

    def at(self, region: Region) -> Float:
        """Values of the members of a region, shape (members, keys)."""
        return self.values.reshape(*self.shape, -1)[region].reshape(-1, len(self.axes))

    def overrides(self, values: Sequence[float]) -> list[str]:
        """One member as overrides of the case file."""
        return [f"{key}={float(v)!r}" for key, v in zip(self.keys, values, strict=True)]

    def blocks(self, members: int) -> tuple[tuple[int, ...], list[Region]]:
        """The members cut into blocks that are rectangles of the grid.

        Args:
            members: in a block, at most.

        Returns:
            Shape of a block, and where each lies; those at the upper ends may be smaller.
        """
        size = []
        for length in reversed(self.shape):
            size.append(max(1, min(length, members)))
            members //= length
        steps = tuple(reversed(size))
        starts = [range(0, n, step) for n, step in zip(self.shape, steps, strict=True)]
        return steps, [
            tuple(
                slice(a, min(a + step, n)) for a, step, n in zip(at, steps, self.shape, strict=True)
            )
            for at in itertools.product(*starts)
        ]


def parsed(text: str) -> Axis:
    """An axis of its text, KEY=FROM:TO:N or KEY=FROM:TO, numbers in SI or with a unit: 3mm.

    Raises:
        SweepError: it has another form, or the range is empty.
    """
    key, equals, rest = text.partition("=")
    key, parts = key.strip(), [part.strip() for part in rest.split(":")]
    if not equals or not all(key.split(".")) or len(parts) not in (2, 3):
        raise SweepError(f"--vary {text}: must be {_FORM}")
    if "*" in key:
        raise SweepError(
            f"--vary {text}: * stands for all layers in [[design.variables]] alone; name one number"
        )
    ends, unit = zip(("FROM", "TO"), parts, strict=False), _unit(key)
    low, high = (_number(text, name, part, unit) for name, part in ends)
    count = 0
    if len(parts) == 3:
        if not parts[2].isdecimal() or int(parts[2]) < 1:
            raise SweepError(f"--vary {text}: N = {parts[2]}: must be a whole number, 1 or greater")
        count = int(parts[2])
    if low > high or (low == high and count != 1) or (count == 1 and low != high):
        few = count == 1 and low < high
        why = (
            "N = 1 is one value of a range; take 2 or more, or FROM = TO"
            if few
            else (f"the range from {low:g} to {high:g} is empty; TO must be greater than FROM")
        )
        raise SweepError(f"--vary {text}: {why}")
    return Axis(key, low, high, count)


def _unit(key: str) -> str:
    """Of a key's number; of a pair's ends, such as layers.0.G_n_a.1, the pair's."""
    names = [part for part in key.split(".") if not part.isdecimal()]
    return unit_of(names[-1]) if names else ""


def _number(text: str, name: str, part: str, unit: str) -> float:
    try:
        value = float(part)
    except ValueError:
        value = float(meant_by(unit, part) or "nan")
        if math.isfinite(value):
            return value
        of = f" in {unit}" if unit else ""
        raise SweepError(
            f"--vary {text}: {name} = {part or 'nothing'}: must be a number{of}; the form is "
            f"{_FORM}"
        ) from None
    if not math.isfinite(value):
        raise SweepError(f"--vary {text}: {name} = {part}: must be finite")
    return value


def variation(
    axes: Sequence[Axis | str], sample: int | None = None, sampler: str = "sobol", seed: int = 0
) -> Variation:
    """The members of a sweep.

    Args:
        axes: the keys and their ranges, each once; as text KEY=FROM:TO:N.
        sample: number of members drawn from the box of all ranges; None takes the grid.
        sampler: "sobol", a scrambled Sobol sequence, or "lhs", a Latin hypercube.
        seed: of the sample; the same seed gives the same members.

    Raises:
        SweepError: no axis, one twice, a grid without a count, or a sample of no members.
    """
    made = tuple(parsed(axis) if isinstance(axis, str) else axis for axis in axes)
    if not made:
        raise SweepError(f"--vary: at least one key is needed; give {_FORM}")
    names = [axis.key for axis in made]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise SweepError(f"--vary {twice}: is given twice; give each key one range")
    if sample is None:
        for axis in made:
            if not axis.count:
                raise SweepError(
                    f"--vary {axis.key}={axis.low:g}:{axis.high:g}: a grid needs the number of "
                    "values, KEY=FROM:TO:N; or draw members from the ranges by --sample N"
                )
        shape = tuple(axis.count for axis in made)
        _check_count(math.prod(shape))
        lines = [np.linspace(axis.low, axis.high, axis.count) for axis in made]
        grid = np.meshgrid(*lines, indexing="ij")
        return Variation(made, np.stack([part.ravel() for part in grid], axis=1), shape, "grid", 0)
    if sampler not in SAMPLERS:
        raise SweepError(f"sampler = {sampler}: must be one of {', '.join(SAMPLERS)}")
    if sample < 1:
        raise SweepError(f"--sample {sample}: must be 1 or greater")
    _check_count(sample)
    values = np.array([axis.low for axis in made]) + _unit_sample(
        sample, len(made), sampler, seed
    ) * [axis.high - axis.low for axis in made]
    return Variation(made, values, (sample,), sampler, seed)


def _check_count(count: int) -> None:
    if count > _MOST:
        raise SweepError(f"{count:.3g} members: at most {_MOST:,} can be; take fewer values")


def _unit_sample(count: int, dimensions: int, sampler: str, seed: int) -> Any:
    """Points of the unit cube, shape (count, dimensions)."""
    from scipy.stats import qmc

    if sampler == "lhs":
        return qmc.LatinHypercube(dimensions, rng=seed).random(count)
    # A Sobol sequence is balanced at powers of 2 alone; its start is taken.
    whole = max(0, math.ceil(math.log2(count)))
    return qmc.Sobol(dimensions, rng=seed).random_base2(whole)[:count]
