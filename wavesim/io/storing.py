"""Chunks of a run stored behind its back, one after another, while further ones are integrated."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

from wavesim.io.result_writer import Results

# result.h5 shows what is stored no sooner than so after the time before, s.
_SHOWN_EVERY = 2.0


class Storing:
    """What stores chunks.

    Args:
        results: where to.
        kept: {field: array (frames, points)} that is filled too: where there is one, packing and
            writing may fall behind, and else they are waited for.
    """

    def __init__(self, results: Results, kept: Mapping[str, Any]) -> None:
        self._results, self._kept = results, kept
        self._keeper, self._writer = ThreadPoolExecutor(1), ThreadPoolExecutor(1)
        self._keeping: list[Future[Mapping[str, Any]]] = []
        self._writing: list[Future[None]] = []
        self._shown_at, self._failed = -math.inf, False

    def __enter__(self) -> Storing:
        return self

    def __exit__(self, *wrong: object) -> None:
        self._keeper.shutdown()
        self._writer.shutdown()

    def add(self, chunk: Any) -> None:
        """Store a chunk of ``timedomain.integrate.stream``.

        Raises:
            WriteError: one before could not be stored.
        """
        if self._failed or not self._kept:
            self.wait()
            self._keeping, self._writing = [], []  # of what is stored nothing is held
        known = chunk.first, chunk.first + chunk.count, chunk.energy, chunk.state
        keeping = self._keeper.submit(self._keep, *known[:2], chunk.values)
        self._keeping.append(keeping)
        self._writing.append(self._writer.submit(self._write, keeping, *known))

    def filled(self) -> None:
        """Wait until all arrays that are kept are filled."""
        for one in self._keeping:
            one.result()

    def wait(self) -> None:
        """Wait until all is stored.

        Raises:
            WriteError: something could not be.
        """
        for one in self._writing:
            one.result()

    def stop(self) -> None:
        """Wait until all is stored that can be, and have result.h5 show it."""
        self._writer.shutdown()
        if not self._failed:
            self._results.present()

    def _keep(self, first: int, end: int, values: Mapping[str, Any]) -> Mapping[str, Any]:
        for name, array in self._kept.items():
            array[first:end] = values[name]
        return {name: array[first:end] for name, array in self._kept.items()} or values

    def _write(
        self, keeping: Future[Mapping[str, Any]], first: int, end: int, energy: Any, state: Any
    ) -> None:
        if self._failed:  # nothing is stored behind a gap
            return
        due = time.monotonic() - self._shown_at > _SHOWN_EVERY
        due = due or end == self._results.simulation.frames
        if due:
            self._shown_at = time.monotonic()
        try:
            self._results.append(first, dict(keeping.result()), energy, state, due)
        except BaseException:
            self._failed = True
            raise
