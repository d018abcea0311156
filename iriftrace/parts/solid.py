"""The files of a made part."""

from __future__ import annotations

from pathlib import Path

import trimesh

from iriftrace.errors import InputError
from iriftrace.part import Part, save_part
from iriftrace.whole_file import whole_file

SUFFIXES = (".ply", ".stl")


def check_file(path: Path) -> None:
    """Refuse a name that is none of a part's file.

    Raises
    ------
    InputError
    """
    if path.suffix.lower() not in SUFFIXES:
        proposed = path.with_name((path.stem or "part") + ".ply")
        raise InputError(
            f"The output {path} must end in .ply, which keeps the named regions, or .stl; name it "
            f"{proposed}, for example."
        )


def save_solid(part: Part, path: str | Path) -> None:
    """Write a part as PLY with its regions, or as STL without, which many programs want.

    Raises
    ------
    InputError
        The name has another ending, or the folder does not exist.
    """
    file = Path(path)
    check_file(file)
    if file.suffix.lower() == ".ply":
        save_part(part, file)
        return
    mesh = trimesh.Trimesh(part.vertices, part.faces, process=False)
    with whole_file(file) as temporary:
        mesh.export(temporary, file_type="stl")
