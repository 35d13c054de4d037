"""Progress on a terminal and in a notebook: stage, part done, times."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager

from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    Task,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.text import Text


class _Left(TimeRemainingColumn):
    """Time to the end of the run: what is left of this stage, and those to come as foreseen."""

    def render(self, task: Task) -> Text:
        foreseen, after = task.fields["foreseen"], task.fields["after"]
        elapsed = task.elapsed or 0.0
        if task.total is not None and task.time_remaining is not None:
            left = task.time_remaining
        elif foreseen:
            left = max(foreseen - elapsed, 0.0)
        else:
            return Text("")
        return Text(f"about {max(left + after, 1.0):.0f} s left")


@contextmanager
def _passing(quiet: bool, *columns: ProgressColumn) -> Iterator[Progress | None]:
    """What is shown while something lasts, and then gone; None when quiet or not on a terminal."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        yield bar


@contextmanager
def progress(
    frames: int, quiet: bool, foreseen: Mapping[str, float] | None = None
) -> Iterator[Callable[[str, float], None]]:
    """Show the progress of a run while it lasts; nothing when quiet or not on a terminal.

    Args:
        frames: of the whole run.
        quiet: show nothing.
        foreseen: how long each stage takes, in their order, s.

    Yields:
        What to call with the name of a stage and the part of it done, 0 to 1. A stage whose
        part is not known stays at 0, and is shown by the time foreseen; only "integrate" has one.
    """
    stages = dict(foreseen or {})
    shown: dict[str, TaskID] = {}
    columns = TextColumn("{task.description:<9}"), BarColumn(bar_width=24)
    with _passing(quiet, *columns, TimeElapsedColumn(), _Left()) as bar:

        def tell(stage: str, part: float) -> None:
            if bar is None:
                return
            if stage not in shown:
                for other in shown.values():
                    bar.update(other, visible=False)
                names = list(stages)
                later = names[names.index(stage) + 1 :] if stage in stages else []
                shown[stage] = bar.add_task(
                    stage,
                    total=frames if stage == "integrate" else None,
                    foreseen=stages.get(stage, 0.0),
                    after=sum(stages[name] for name in later),
                )
            if stage == "integrate":
                bar.update(shown[stage], completed=part * frames)

        yield tell


@contextmanager
def part_done(what: str = "integrate") -> Iterator[Callable[[float], None]]:
    """A progress bar while something lasts, in a notebook or on a terminal.

        with ws.progress() as tell:
            field = ws.integrate(simulation, tell)

    Yields:
        What to call with the part done, 0 to 1.
    """
    with Progress(
        TextColumn("{task.description}"),
        BarColumn(bar_width=24),
        TextColumn("{task.percentage:.0f} %"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    ) as bar:
        task = bar.add_task(what, total=1.0)
        yield lambda part: bar.update(task, completed=part)


@contextmanager
def counted(what: str, quiet: bool = False) -> Iterator[Callable[..., None]]:
    """Show how many of some things are done while it lasts, and how long the rest takes; nothing
    when quiet or not on a terminal.

    Yields:
        What to call with how many are done, all there are, and how many failed, if any.
    """
    text = f"{{task.completed:.0f}} of {{task.total:.0f}} {what}{{task.fields[failed]}}"
    columns = TextColumn(text), BarColumn(bar_width=24), TimeElapsedColumn(), TimeRemainingColumn()
    with _passing(quiet, *columns) as bar:
        task = bar.add_task(what, total=1, failed="") if bar else TaskID(0)

        def tell(done: int, of: int, failed: int = 0) -> None:
            told = f", {failed} failed" if failed else ""
            if bar:
                bar.update(task, completed=done, total=of, failed=told)

        yield tell


@contextmanager
def working(what: str, quiet: bool = False) -> Iterator[Callable[[str], None]]:
    """Show that something is under way, and since when, where no one knows how long it takes;
    nothing when quiet or not on a terminal.

    Yields:
        What to call with how far it is, in words.
    """
    columns = SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn()
    with _passing(quiet, *columns) as bar:
        task = bar.add_task(what, total=None) if bar else TaskID(0)
        yield lambda text: bar.update(task, description=f"{what}: {text}") if bar else None
