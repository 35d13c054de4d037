"""What a run takes: time, memory and disk, said before it begins; from its plan and the machine.

Counts (products, points, bytes) are those of the plan; what each takes was measured once, on two
cores, and is scaled by how fast this machine is now at the same kind of work.
"""

from __future__ import annotations

import functools
import os
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wavesim.material.scaling import JUDGED
from wavesim.simulation.field import MOST_WAVENUMBERS
from wavesim.simulation.simulation import Simulation
from wavesim.timedomain.time_step import RUN, TimeStep, chunk_frames

# Seconds on the machine that was measured on, quiet; to compile, between what is compiled anew and
# what is kept on disk; products of states in the cache take less.
_START, _COMPILE = 1.1, {"propagator": 1.0, "chebyshev": 1.4}
_PER_FLOP, _PER_PRODUCT = 3.0e-11, {"propagator": 1.0e-5, "chebyshev": 3.5e-6}
# Of a series with relaxations, in more layers than these, a product of states.
_MANY_LAYERS, _PER_LAYERED = 3, 1.0e-5
# A number of a state: within the cache, how much more beyond it, where that begins, how sharply.
_PER_POINT = {
    "propagator": (4.0e-9, 1.1e-8, 4.0e4, 1.0),
    "chebyshev": (1.5e-9, 3.5e-9, 3.0e5, 2.0),
}
# What a relaxation adds to the work on a number.
_PER_MEMORY = 1 / 3
_PER_FRAME = 1.0e-4
_PER_STORED, _PER_READ = 8.0e-9, 5.0e-9  # a byte
_ENDLESS, _PER_SPECTRUM, _BAR, _PER_SIGNAL, _PAGE = 0.4, 6.0e-8, 0.4, 2.0e-7, 0.7
# Bytes: what is loaded and compiled, here and in the process beside; how many times a chunk and a
# state are held; what a packed number takes where waves are; page and picture.
_LOADED, _CHUNKS, _STATES, _PACKED, _SHOWN = 0.48e9, 8, 20, 6.9, 5.5e6
# What parts of a field hold that is not kept, as it is written, analysed and drawn.
_READ_AGAIN = 0.25e9
# So much faster than waves travels what is no more than rounding, but takes as much room.
_FRONT = 1.5
_LOOKED_AT = 64
# What is packed together reaches so many cells further than what moves.
_PACKED_ALONG = 256
# Of a ring are stored: its spectrum, padded and with a margin; of so many columns a decay.
_PADDED, _MARGIN, _DECAYS = 4, 1.25, 120
# What the same work took there: a product and a sum of arrays by one thread, and a loop of Python.
_PRODUCT_THEN, _LOOP_THEN = 3.0e-5, 2.8e-3
_PART_OF_MEMORY = 0.8
# A field of so many bytes, or this part of the memory, is kept there until its run has ended.
_KEPT, _PART_KEPT = 0.5e9, 0.05
# Disk that a run takes at its end, over what stays.
_WHILE_GATHERED = 2.0
HOUR = 3600.0


@dataclass(frozen=True)
class Cost:
    """What a run takes.

    Attributes:
        stages: wall time of each stage, s.
        memory: largest, bytes.
        disk: of its folder, bytes.
    """

    stages: dict[str, float]
    memory: float
    disk: float

    @property
    def seconds(self) -> float:
        """Wall time of all, s."""
        return sum(self.stages.values())

    @property
    def in_words(self) -> str:
        """Such as "about 3 days, 2.1 GB of memory and 65 GB of disk"."""
        taken = duration_in_words(self.seconds)
        return f"about {taken}, {size(self.memory)} of memory and {size(self.disk)} of disk"


def size(count: float) -> str:
    """Bytes in MB, GB or TB."""
    unit, name = next((u, n) for u, n in ((1e12, "TB"), (1e9, "GB"), (0.0, "MB")) if count >= u)
    return f"{count / (unit or 1e6):.3g} {name}"


def duration_in_words(seconds: float) -> str:
    """A time in the largest unit that it has two of, or seconds."""
    for unit, name in ((31557600.0, "years"), (604800.0, "weeks"), (86400.0, "days"),
                       (3600.0, "hours"), (60.0, "minutes")):  # fmt: skip
        if seconds >= 2 * unit:
            return f"{float(f'{seconds / unit:.2g}'):g} {name}"
    return f"{float(f'{seconds:.2g}'):g} seconds"


@functools.cache
def slowness() -> tuple[float, float]:
    """How much longer this machine takes than that which was measured on: arithmetic, Python.

    Takes a tenth of a second; once in a process. The best of some tries, in time of the processor:
    what else the machine is at just now says nothing of the run. No function such as exp is among
    them: processors whose instructions numpy has none for take nine times as long for it alone.
    """
    a = np.linspace(0.5, 1.0, 100_000)
    made = np.empty_like(a)

    def product() -> None:
        np.multiply(a, a, out=made)
        np.add(made, a, out=made)

    def loop() -> None:
        sum(i * i for i in range(100_000))

    found = []
    for work, then in ((product, _PRODUCT_THEN), (loop, _LOOP_THEN)):
        work()
        begun, best = time.perf_counter(), float("inf")
        while time.perf_counter() - begun < 0.04 or not np.isfinite(best):
            since = time.thread_time()
            work()
            best = min(best, time.thread_time() - since)
        found.append(best / then)
    return found[0], found[1]


def cost(
    simulated: Simulation, steps: TimeStep, page: bool = True, k_max: float | None = None
) -> Cost:
    """What a run takes.

    Args:
        simulated: the simulation.
        steps: how it is stepped.
        page: whether it is judged, stored and shown, as ``wavesim run`` does; else it is kept in
            memory, as ``simulate`` does.
        k_max: highest wavenumber of a spectrum, rad/m; that judged by default where None.
    """
    frames, cells, count = simulated.frames, simulated.bar.cells, len(simulated.fields)
    numbers = float(frames) * cells * count
    arithmetic, python = slowness()
    state = float(cells * count)
    memories = max(len(layer.medium.damping.rates) for layer in simulated.layers.layers)
    worked = state * (1 + memories * _PER_MEMORY)
    near, far, cached, power = _PER_POINT.get(steps.solver, _PER_POINT["propagator"])
    each = _PER_PRODUCT.get(steps.solver, 1.0e-5)
    each += worked * (near + far / (1 + (cached / worked) ** power))
    if memories and len(simulated.layers.layers) > _MANY_LAYERS:
        each += _PER_LAYERED
    if steps.solver == "propagator":
        window = RUN + 2 * steps.reach
        fields = sum(len(b.macro + b.micro) ** 2 for b in simulated.blocks)
        each += _PER_FLOP * 2.0 * cells * window * fields
    stages = {
        "import": python * _START,
        "compile": python * _COMPILE.get(steps.solver, 1.0),
        "integrate": arithmetic * (steps.operator_products * each + frames * _PER_FRAME),
    }
    memory = _LOADED + 8.0 * state * (_STATES + _CHUNKS * chunk_frames(simulated))
    if not page:
        return Cost(stages, memory + 2 * 8 * numbers, 0.0)
    kept = in_memory(simulated)
    if kept:
        memory += 1.6 * 8 * numbers  # much of it is there twice, in the process beside
    elif not simulated.endless:
        memory += _READ_AGAIN
    moving = numbers * _reached(simulated)
    stages["integrate"] += arithmetic * 8 * moving * _PER_STORED
    read = arithmetic * 8 * numbers * _PER_READ
    disk = _PACKED * moving + 0.02 * numbers + _SHOWN
    if simulated.endless:
        stages["analyse"] = read + python * _ENDLESS + arithmetic * _PER_SPECTRUM * numbers
        held, stored = _of_ring(simulated, k_max)
        memory, disk = memory + held, disk + stored
    else:
        signals = float(frames) * len(simulated.receivers) * len(simulated.layers.layers)
        own = arithmetic * _PER_SIGNAL * signals * len(simulated.blocks)
        stages["analyse"] = read + python * _BAR + own
    drawn = python * _PAGE + (0.0 if kept else 1.5 * read)  # the process beside reads it too
    return Cost(stages | {"figures": drawn}, memory, disk)


def _of_ring(simulated: Simulation, k_max: float | None) -> tuple[float, float]:
    """What spectra and decays of a ring take in memory, and on disk, bytes."""
    bar, frames = simulated.bar, simulated.frames
    unit = 2 * np.pi / float(simulated.medium.length_scale)
    count = min(_MARGIN * (k_max or JUDGED[1] * unit) * bar.length / (2 * np.pi), bar.cells / 2)
    waves = count / np.ceil(count / MOST_WAVENUMBERS)
    shown = min(1.0, simulated.band * simulated.interval / np.pi)
    sectors = len({block.sector for block in simulated.blocks})
    power = 8.0 * waves * _PADDED * frames * shown
    held = 8.0 * frames * min(bar.cells // 2 + 1, MOST_WAVENUMBERS) * 4 + 12.0 * _DECAYS * bar.cells
    decays = 0.36 * _DECAYS * bar.cells
    return held + power, sectors * (0.86 * power + decays)


def in_memory(simulated: Simulation) -> bool:
    """Whether a run keeps its field in memory until it has ended, beside storing it."""
    size = 8.0 * simulated.frames * simulated.bar.cells * len(simulated.fields)
    return size <= min(_KEPT, _PART_KEPT * _memory())


def _memory() -> float:
    """Memory of this machine, bytes."""
    return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))


def _reached(simulated: Simulation) -> float:
    """Part of the bar that anything reaches, mean over the run: at rest it takes no room."""
    bar, layers = simulated.bar, simulated.layers
    speed = _FRONT * max(medium.fastest for medium in layers.media)
    further = _PACKED_ALONG * bar.spacing if bar.cells > 4 * _PACKED_ALONG else 0.0
    found = []
    for t in np.linspace(0.0, simulated.duration, _LOOKED_AT):
        spans = []
        for source in simulated.sources:
            reach = speed * max(t - max(source.onset, 0.0), 0.0) + 4 * source.width + further
            for shift in (-bar.length, 0.0, bar.length) if bar.periodic else (0.0,):
                low, high = source.position + shift - reach, source.position + shift + reach
                spans.append((max(low, 0.0), min(high, bar.length)))
        total, end = 0.0, 0.0
        for low, high in sorted(spans):
            total += max(0.0, high - max(low, end))
            end = max(end, high)
        found.append(total / bar.length)
    return float(np.mean(found))


def check_cost(
    simulated: Simulation, found: Cost, at_most: float = HOUR, folder: Path | None = None
) -> None:
    """Hold a run to this machine's memory, to the room on its disk and to a time.

    Args:
        simulated: the simulation.
        found: what it takes.
        at_most: longest time, s.
        folder: that it writes into; None where it writes nothing.

    Raises:
        ValueError: it takes more; the message says how much, and what would fit.
    """
    memory = _PART_OF_MEMORY * _memory()
    room = float("inf") if folder is None else free(folder)
    given = f"duration = {simulated.duration:g}"
    frames, cells = simulated.frames, simulated.bar.cells
    asked = f"{given}: {frames} frames of {cells} cells take {found.in_words}"
    if found.memory > memory:
        part = max(memory - _LOADED, 0.0) / (found.memory - _LOADED)
        raise ValueError(
            f"{asked}; more memory than {size(memory)}, which this machine has to give: take at "
            f"most {rounded(cells * part)} cells, or fewer [time] samples"
        )
    if _WHILE_GATHERED * found.disk > room:
        fits = rounded(frames * room / (_WHILE_GATHERED * found.disk))
        raise ValueError(
            f"{asked}, twice that while its parts are made one file; more disk than {size(room)}, "
            f"which is free there: take at most {fits} [time] samples, make room, or name another "
            "folder with --out"
        )
    if found.seconds > at_most:
        part = at_most / found.seconds
        raise ValueError(
            f"{asked}; longer than {duration_in_words(at_most)}: take at most "
            f"duration = {simulated.duration * part:.2g}, or allow more with --at-most "
            f"{max(1, round(1.5 * found.seconds / HOUR))}h (at_most in Python)"
        )


def rounded(count: float) -> str:
    """Two digits of a number, downwards."""
    whole = max(int(count), 0)
    step = 10 ** max(len(str(whole)) - 2, 0)
    return str(whole // step * step)


def free(folder: Path) -> float:
    """Bytes free where a folder is, or is to be."""
    import shutil

    place = folder.absolute()
    while not place.exists() and place != place.parent:
        place = place.parent
    try:
        return float(shutil.disk_usage(place).free)
    except OSError:
        return float("inf")


def seconds_of(text: str) -> float:
    """A time such as "90", "90s", "30min", "2h", "1d" or "1w", s.

    Raises:
        ValueError: it is none.
    """
    units = {"": 1.0, "s": 1.0, "min": 60.0, "h": HOUR, "d": 24 * HOUR, "w": 168 * HOUR}
    number = text.strip().rstrip("abcdefghijklmnopqrstuvwxyz")
    unit = units.get(text.strip()[len(number) :])
    try:
        value = float(number) * unit if unit else 0.0
    except ValueError:
        value = 0.0
    if not (value > 0 and value < float("inf")):
        raise ValueError("must be a time such as 90s, 30min, 2h or 1d")
    return value
