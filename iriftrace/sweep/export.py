"""Sweeps for other programs: a plain table, and the part with its maps for ParaView."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from iriftrace.core.errors import InputError, SetupError
from iriftrace.core.files import whole_file
from iriftrace.core.mesh.triangles import polydata
from iriftrace.io.vtk_write import write_vtk
from iriftrace.part.part import Part
from iriftrace.sweep.store import WHOLE_PART

if TYPE_CHECKING:
    import xarray as xr


def check_table(path: Path) -> None:
    """Check that the table can be written before starting the computation.

    Raises InputError for an ending other than ``.csv`` or ``.parquet``, SetupError without pyarrow.
    """
    _check_suffix(path, "table", (".csv", ".parquet"))
    if path.suffix.lower() == ".parquet" and find_spec("pyarrow") is None:
        raise SetupError(
            f"{path} needs pyarrow, which is not installed; in the clone: "
            "pip install -e '.[parquet]', or write a .csv file.",
            code="table.no_pyarrow",
            argument="export",
        )


def _check_suffix(path: Path, what: str, suffixes: tuple[str, ...]) -> None:
    if path.suffix.lower() not in suffixes:
        raise InputError(
            f"The {what} {path} must end in {' or '.join(suffixes)}, which states its format; "
            "rename it.",
            code="file.ending",
        )


def write_table(path: Path, dataset: xr.Dataset) -> None:
    """Write the values of the whole part, one row for each pose; the suffix sets the format.

    Raises as `check_table`, and InputError if the file cannot be written.
    """
    check_table(path)
    others = [name for name in dataset.sizes if name not in ("pose", "region")]
    table = dataset.drop_dims(others).sel(region=WHOLE_PART).drop_vars("region").to_dataframe()
    # A table has no header for values that hold for all poses.
    # A negative count is one that a pose does not have.
    for name in table.select_dtypes("integer"):
        table[name] = table[name].astype("Int64").mask(table[name] < 0)
    table["wavelength_nm"] = dataset.attrs.get("wavelength_nm")
    with whole_file(path) as temporary:
        if path.suffix.lower() == ".csv":
            table.to_csv(temporary)
        else:
            table.to_parquet(temporary, engine="pyarrow")


def write_face_maps(path: Path, dataset: xr.Dataset, part: Part) -> None:
    """Write the part that was swept (.vtp, .vtu), faces in its file's order, with cell data.

    The arrays are ``displacement (um)``, the mean over all good rays of all poses, ``times seen``,
    the number of poses, ``best incidence (deg)``, the smallest angle of incidence, and ``region``,
    its number. Displacement and incidence of a face that was never seen are NaN.

    Raises InputError for another ending or part, or if the file cannot be written.
    """
    _check_suffix(path, "surface", (".vtp", ".vtu"))
    if dataset.sizes.get("face") != len(part.faces):
        raise InputError(
            f"The sweep has maps of {dataset.sizes.get('face', 0)} faces, but {part.path} has "
            f"{len(part.faces)}; give the part that was swept.",
            code="sweep.face_count",
        )
    surface = polydata(part.vertices, part.faces)
    micrometres = 1e3 * dataset["face_displacement"].values.astype(np.float64)
    surface.cell_data["displacement (um)"] = micrometres.astype(np.float32)
    surface.cell_data["times seen"] = dataset["face_times_seen"].values
    surface.cell_data["best incidence (deg)"] = dataset["face_incidence"].values
    surface.cell_data["region"] = dataset["face_region"].values
    solid = path.suffix.lower() == ".vtu"
    write_vtk(path, surface.cast_to_unstructured_grid() if solid else surface)
