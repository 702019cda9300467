"""What a benchmark prints."""

from dataclasses import dataclass

Cell = str | int | float | None
"""None is printed as `-`: there is nothing to say, and a note says why."""


@dataclass(frozen=True)
class Table:
    """Rows under a title; `notes` follow them, one a line."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    notes: tuple[str, ...] = ()

    def text(self) -> str:
        """Columns aligned, the first to the left and the others to the right."""
        lines = [self.columns, *(tuple(map(_shown, row)) for row in self.rows)]
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        aligned = [
            "  ".join([line[0].ljust(widths[0]), *map(str.rjust, line[1:], widths[1:])]).rstrip() for line in lines
        ]
        rule = "  ".join("-" * width for width in widths)
        return "\n".join([self.title, "", aligned[0], rule, *aligned[1:], *(f"* {note}" for note in self.notes)])


def _shown(cell: Cell) -> str:
    if cell is None:
        return "-"
    if isinstance(cell, float):
        return f"{cell:,.0f}" if 1000 <= cell < 1e9 else f"{cell:.3g}"
    return f"{cell:,}" if isinstance(cell, int) else cell
