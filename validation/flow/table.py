"""Tables of the page: values of a solution, and the difference of a computation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from attrs import Factory, frozen
from numpy.typing import ArrayLike


@frozen
class Table:
    """Rows of numbers in Markdown, and the differences beyond their bounds."""

    columns: Sequence[str]
    rows: list[str] = Factory(list)
    beyond: list[str] = Factory(list)

    def expected(self, name: str, values: ArrayLike, digits: int = 4) -> None:
        """A row of the solution's values."""
        self.row(name, [f"{value:.{digits}g}" for value in np.asarray(values)])

    def difference(self, name: str, per_cent: ArrayLike, bound: ArrayLike | None = None) -> None:
        """A row of differences, per cent, with those beyond a bound, or that of each, in bold."""
        texts = []
        bounds = np.broadcast_to(np.inf if bound is None else bound, len(self.columns))
        for column, value, most in zip(self.columns, np.asarray(per_cent), bounds, strict=True):
            text = f"{round(float(value), 1) + 0.0:+.1f} %"
            if not abs(value) <= most:
                self.beyond.append(f"{name}, {column}: {text}, at most {most:g} %")
                text = f"**{text}**"
            texts.append(text)
        self.row(name, texts)

    def row(self, name: str, cells: Sequence[str]) -> None:
        """A row of texts."""
        self.rows.append(f"| {name} | {' | '.join(cells)} |")

    @property
    def text(self) -> str:
        """The table in Markdown."""
        head = f"| | {' | '.join(self.columns)} |"
        return "\n".join((head, "|---" * (len(self.columns) + 1) + "|", *self.rows))


def per_cent(found: ArrayLike, expected: ArrayLike) -> ArrayLike:
    """Relative difference, %."""
    return 100.0 * (np.asarray(found) / np.asarray(expected) - 1.0)
