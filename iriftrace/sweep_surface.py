"""The part with what a sweep found out about each of its faces, for ParaView."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from iriftrace.errors import InputError
from iriftrace.part import Part
from iriftrace.whole_file import whole_file

if TYPE_CHECKING:
    import xarray as xr

SUFFIXES = (".vtp", ".vtu")


def check_surface(path: Path) -> None:
    """Refuse before the work a surface that could not be written after it.

    Raises
    ------
    InputError
        If its name ends in something else than ``.vtp`` or ``.vtu``.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(
            f"The surface {path} must end in {' or '.join(SUFFIXES)}, which ParaView opens; name "
            "it so."
        )


def write_surface(path: Path, dataset: xr.Dataset, part: Part) -> None:
    """Write the part's faces in the order of its file, with cell data.

    The arrays are ``displacement (um)``, the mean over all good rays of all poses, ``times seen``,
    the number of poses, ``best incidence (deg)``, the smallest angle of incidence, and ``region``,
    its number. Displacement and incidence of a face that was never seen are NaN.

    Parameters
    ----------
    path : Path
        A .vtp or .vtu file.
    dataset : xarray.Dataset
        The sweep.
    part : Part
        What was swept.

    Raises
    ------
    InputError
        If the name has another ending, the file cannot be written, or the part is another one.
    """
    from iriftrace.figure_surfaces import surface_of

    check_surface(path)
    if dataset.sizes.get("face") != len(part.faces):
        raise InputError(
            f"The sweep has maps of {dataset.sizes.get('face', 0)} faces, but {part.path} has "
            f"{len(part.faces)}; give the part that was swept."
        )
    surface = surface_of(part.vertices, part.faces)
    micrometres = 1e3 * dataset["face_displacement"].values.astype(np.float64)
    surface.cell_data["displacement (um)"] = micrometres.astype(np.float32)
    surface.cell_data["times seen"] = dataset["face_times_seen"].values
    surface.cell_data["best incidence (deg)"] = dataset["face_incidence"].values
    surface.cell_data["region"] = dataset["face_region"].values
    with whole_file(path) as temporary:
        if path.suffix.lower() == ".vtu":
            surface.cast_to_unstructured_grid().save(temporary)
        else:
            surface.save(temporary)
