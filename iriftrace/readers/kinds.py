"""Which program wrote a field file, told by its name and what lies beside it."""

from __future__ import annotations

from pathlib import Path

from iriftrace.errors import InputError

VTK = (".vtu", ".pvtu", ".vtk", ".vti", ".vtr", ".vts", ".pvd", ".vtm")
OPENFOAM = (".foam", ".openfoam")
COMSOL_TEXT = (".txt", ".csv", ".dat")
COMPRESSED = (".gz", ".zip", ".bz2", ".xz", ".7z")
SUFFIXES = (*VTK, *OPENFOAM, *COMSOL_TEXT)
"""Suffixes of files that can hold a field; an OpenFOAM case may also be named by its folder."""


def kind_of(path: Path) -> str:
    """``"vtk"``, ``"openfoam"`` or ``"comsol"``.

    Raises
    ------
    InputError
        The file does not exist, is of another type, or is a folder that is no OpenFOAM case.
    """
    if path.is_dir():
        if is_case(path):
            return "openfoam"
        raise InputError(
            f"The folder {path} is no OpenFOAM case (it has neither system/controlDict nor "
            "constant/polyMesh); name the case's folder or the field's file."
        )
    if not path.is_file():
        raise InputError(f"The field file {path} does not exist; check the path.")
    suffix = path.suffix.lower()
    if suffix in OPENFOAM or path.name == "controlDict":
        return "openfoam"
    if suffix in COMSOL_TEXT:
        return "comsol"
    if suffix in VTK:
        return "vtk"
    if suffix in COMPRESSED:
        raise InputError(f"The field file {path} is compressed; unpack it first.")
    raise InputError(
        f"{path} is not a field file that can be read here; export it as one of "
        f"{', '.join(SUFFIXES)}, or name the folder of an OpenFOAM case."
    )


def is_case(folder: Path) -> bool:
    """Whether a folder looks like an OpenFOAM case, reconstructed or decomposed."""
    return any(
        (folder / name).exists()
        for name in ("system/controlDict", "constant/polyMesh", "processor0/constant/polyMesh")
    )
