"""Tables whose numbers are whole however narrow the terminal is."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderResult
from rich.measure import Measurement
from rich.table import Column, Table

# Words are broken into no less than this, in characters.
_WORD = 12


class NumberTable(Table):
    """A table of words, in columns that may be wrapped, and numbers, in columns that may not.

    Where it is too wide its columns of numbers stand below each other, a part with as many as there
    is room for, each part after the words that lead; a number alone too wide goes on in the next
    line.
    """

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        parts = list(self._parts(console, options))
        for columns in parts if len(parts) > 1 else []:
            yield self._of(columns)
        if len(parts) == 1:
            yield from super().__rich_console__(console, options)

    def _parts(self, console: Console, options: ConsoleOptions) -> Iterable[list[Column]]:
        lead = [column for column in self.columns if not column.no_wrap]
        rest = [column for column in self.columns if column.no_wrap]
        if not lead:
            lead, rest = rest[:1], rest[1:]
        if self._least(console, options, self.columns) <= options.max_width or not rest:
            yield list(self.columns)
            return
        taken = lead
        for column in rest:
            if taken != lead and (
                self._least(console, options, [*taken, column]) > options.max_width
            ):
                yield taken
                taken = lead
            taken = [*taken, column]
        yield taken

    def _least(self, console: Console, options: ConsoleOptions, columns: Sequence[Column]) -> int:
        """Width that these take when words are broken as far as they may be."""
        table = Table(box=self.box, pad_edge=self.pad_edge, padding=self.padding)
        table.show_edge = self.show_edge
        for column in columns:
            width = max(_width(str(cell)) for cell in (column.header, *column.cells))
            table.add_column(width=width if column.no_wrap else min(width, _WORD))
        return Measurement.get(console, options.update(max_width=10_000), table).maximum

    def _of(self, columns: Sequence[Column]) -> Table:
        part = Table(box=self.box, pad_edge=self.pad_edge, padding=self.padding)
        part.show_edge = self.show_edge
        alone = len(columns) == 2
        for column in columns:
            part.add_column(
                column.header,
                justify=column.justify,
                no_wrap=column.no_wrap and not alone,
                overflow="fold",
            )
        cells = [list(column.cells) for column in columns]
        for row, values in zip(self.rows, zip(*cells, strict=True), strict=True):
            part.add_row(*values, style=row.style, end_section=row.end_section)
        return part


def _width(cell: str) -> int:
    return max((cell_len(line) for line in cell.splitlines()), default=0)
