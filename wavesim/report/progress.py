"""Progress on a terminal and in a notebook: stage, part done, times."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager

from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    SpinnerColumn,
    Task,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.progress_bar import ProgressBar
from rich.text import Text

# A stage whose part done is not known is shown no further than this before it ends.
_NEARLY = 0.97


class _Bar(BarColumn):
    """How far a stage is: by its frames, or else by the time that it was foreseen to take."""

    def render(self, task: Task) -> ProgressBar:
        foreseen = task.fields["foreseen"]
        if task.total is None and foreseen and task.elapsed is not None:
            part = min(task.elapsed / foreseen, _NEARLY)
            return ProgressBar(total=1.0, completed=part, width=self.bar_width)
        return super().render(task)


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
    if quiet or not sys.stderr.isatty():
        yield lambda stage, part: None
        return
    stages = dict(foreseen or {})
    shown: dict[str, TaskID] = {}
    with Progress(
        TextColumn("{task.description:<9}"),
        _Bar(bar_width=24),
        TimeElapsedColumn(),
        _Left(),
        console=Console(stderr=True),
        transient=True,
    ) as bar:

        def tell(stage: str, part: float) -> None:
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
    if quiet or not sys.stderr.isatty():
        yield lambda done, of, failed=0: None
        return
    text = f"{{task.completed:.0f}} of {{task.total:.0f}} {what}{{task.fields[failed]}}"
    with Progress(
        TextColumn(text),
        BarColumn(bar_width=24),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        transient=True,
    ) as bar:
        task = bar.add_task(what, total=1, failed="")

        def tell(done: int, of: int, failed: int = 0) -> None:
            told = f", {failed} failed" if failed else ""
            bar.update(task, completed=done, total=of, failed=told)

        yield tell


@contextmanager
def working(what: str, quiet: bool = False) -> Iterator[Callable[[str], None]]:
    """Show that something is under way, and since when, where no one knows how long it takes;
    nothing when quiet or not on a terminal.

    Yields:
        What to call with how far it is, in words.
    """
    if quiet or not sys.stderr.isatty():
        yield lambda text: None
        return
    with Progress(
        SpinnerColumn(),
        TextColumn("{task.description}"),
        TimeElapsedColumn(),
        console=Console(stderr=True),
        transient=True,
    ) as bar:
        task = bar.add_task(what, total=None)
        yield lambda text: bar.update(task, description=f"{what}: {text}")
