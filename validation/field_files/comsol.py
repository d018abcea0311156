"""Writes fields as COMSOL's text exports: spreadsheet, sectionwise and grid."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

_WIDTH = 25


def header(
    *,
    nodes: int,
    expressions: int,
    elements: int | None = None,
    length_unit: str | None = "mm",
) -> list[str]:
    """The lines above the data, as COMSOL 6 writes them."""
    entries = {
        "Model": "part.mph",
        "Version": "COMSOL 6.2.0.415",
        "Date": "Mar 25 2026, 09:23",
        "Dimension": 3,
        "Nodes": nodes,
        "Elements": elements,
        "Expressions": expressions,
        "Description": "Temperature",
        "Length unit": length_unit,
    }
    return [f"% {key + ':':<20}{value}" for key, value in entries.items() if value is not None]


def spreadsheet(
    path: Path,
    points: FloatArray,
    columns: Mapping[str, FloatArray],
    *,
    separator: str = " ",
    decimal: str = ".",
    newline: str = "\n",
    axes: Sequence[str] = ("x", "y", "z"),
    length_unit: str | None = "mm",
) -> Path:
    """Write points and results in rows; columns are named as ``T (K) @ t=1``."""
    names = [*axes, *columns]
    rows = np.column_stack([points, *columns.values()])
    lines = header(nodes=len(points), expressions=len(columns), length_unit=length_unit)
    if separator == " ":
        lines.append("% " + "".join(f"{name} ".ljust(_WIDTH) for name in names))
        lines += ["".join(_number(v, decimal).ljust(_WIDTH) for v in row) for row in rows]
    else:
        lines.append("% " + separator.join(names))
        lines += [separator.join(_number(v, decimal) for v in row) for row in rows]
    path.write_bytes((newline.join(lines) + newline).encode())
    return path


def sectionwise(
    path: Path,
    points: FloatArray,
    tetrahedra: IntArray,
    columns: Mapping[str, FloatArray],
    *,
    word: str = "tetrahedra",
    separator: str = " ",
    decimal: str = ".",
    newline: str = "\n",
    length_unit: str | None = "mm",
) -> Path:
    """Write points, elements (numbered from 1) and one section for every result."""
    between = separator if separator != " " else " " * 8
    counts = {"nodes": len(points), "elements": len(tetrahedra), "expressions": len(columns)}
    lines = [*header(**counts, length_unit=length_unit), "% Coordinates"]
    lines += [between.join(_number(v, decimal) for v in row) for row in points]
    lines.append(f"% Elements ({word})")
    lines += [between.join(str(n + 1) for n in row) for row in tetrahedra.tolist()]
    for name, values in columns.items():
        lines.append(f"% Data ({name})")
        lines += [_number(v, decimal) for v in values]
    path.write_bytes((newline.join(lines) + newline).encode())
    return path


def grid(path: Path, axes: Sequence[FloatArray], columns: Mapping[str, FloatArray]) -> Path:
    """Write a regular grid, mm; results (nz, ny, nx)."""
    count = int(np.prod([len(axis) for axis in axes]))
    lines = [*header(nodes=count, expressions=len(columns)), "% Grid"]
    lines += ["".join(_number(v, ".").ljust(_WIDTH) for v in axis) for axis in axes]
    for name, values in columns.items():
        rows = values.reshape(-1, len(axes[0]))
        lines += ["% Data", f"% {name}"]
        lines += ["".join(_number(v, ".").ljust(_WIDTH) for v in row) for row in rows]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def _number(value: float, decimal: str) -> str:
    return "NaN" if np.isnan(value) else f"{value:.16G}".replace(".", decimal)
