"""Field file of a scene, which the cells engine integrates rays through."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING
from zipfile import ZIP_DEFLATED, ZipFile

import numpy as np
from attrs import frozen
from numpy.lib.format import write_array

from iriftrace.core.files import arrays_in, whole_file
from iriftrace.core.plain import plain, structured
from iriftrace.io.refusals import check_exists, check_schema, damaged
from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.gradient import CORNERS
from iriftrace.medium.path_data import FieldCells, cells_of
from iriftrace.medium.source import FieldSource

if TYPE_CHECKING:
    from iriftrace.medium.index_field import IndexField

FIELD_FILE = "field.npz"
"""Name of the field file next to a scene's XML."""


SCHEMA = "iriftrace.field/1"


@frozen
class _Header:
    schema: str
    air: Air
    ambient: float
    source: FieldSource


ARRAYS = ("points", "refractivity", "celltypes", "cell_connectivity", "wall")


def save_field_file(field: IndexField, path: str | Path) -> Path:
    """Write a field file (NumPy's .npz, compressed); raises InputError if that fails."""
    cells = cells_of(field)
    arrays = {name: getattr(cells, name) for name in ARRAYS}
    header = plain(_Header(SCHEMA, cells.air, cells.ambient, cells.source))
    arrays["header"] = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)
    # As numpy.savez_compressed, whose level of 6 takes four times as long for files of this size.
    with (
        whole_file(path) as temporary,
        ZipFile(temporary, "w", ZIP_DEFLATED, compresslevel=1) as archive,
    ):
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
                write_array(file, array, allow_pickle=False)
    return Path(path)


def load_field_file(path: str | Path) -> FieldCells:
    """Read what `save_field_file` wrote; InputError if missing, damaged or of another schema."""
    check_exists(Path(path), "`iriftrace scene` writes it for the cells engine")
    try:
        arrays = arrays_in(Path(path), (*ARRAYS, "header"))
        header = structured(json.loads(arrays.pop("header").tobytes()), _Header)
    except (ValueError, LookupError, TypeError, RecursionError) as error:
        raise damaged(path, error, "write the scene again") from error
    check_schema(path, header.schema, SCHEMA, "write the scene again")
    cells = FieldCells(**arrays, air=header.air, ambient=header.ambient, source=header.source)
    fault = _fault(cells)
    if fault:
        raise damaged(path, fault, "write the scene again")
    return cells


def _fault(cells: FieldCells) -> str:
    """What is wrong with the arrays; "" if they are consistent."""
    kinds = {"points": "f4", "refractivity": "f8", "celltypes": "u1", "wall": "b1"}
    kinds["cell_connectivity"] = "i4"
    if any(getattr(cells, name).dtype != np.dtype(kind) for name, kind in kinds.items()):
        return "its arrays have other types of numbers"
    count = len(cells.points)
    if not (
        cells.points.shape == (count, 3)
        and cells.refractivity.shape == cells.wall.shape == (count,)
        and cells.celltypes.ndim == 1
        and len(cells.celltypes)
        and np.isin(cells.celltypes, list(CORNERS)).all()
        and cells.cell_connectivity.shape == (cells.cell_offsets[-1],)
        and (cells.cell_connectivity >= 0).all()
        and (cells.cell_connectivity < count).all()
    ):
        return "its cells do not fit its points"
    if not (np.isfinite(cells.points).all() and np.isfinite(cells.refractivity).all()):
        return "its points or their indices are not all finite numbers"
    return ""
