"""Shells on disk: one PLY each for the renderer, `shells.vtm` for ParaView, a JSON table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING
from xml.sax.saxutils import quoteattr

import numpy as np
from attrs import evolve

from iriftrace.core.arrays import AnyIntArray, Float32Array
from iriftrace.core.errors import InputError
from iriftrace.core.files import make_folder, seen_from, sha256_of, write_json, write_whole
from iriftrace.core.mesh.triangles import polydata
from iriftrace.core.plain import plain
from iriftrace.io import ply
from iriftrace.io.json_files import read_json
from iriftrace.io.refusals import check_exists, damaged
from iriftrace.io.vtk_write import write_vtk
from iriftrace.medium.shells.hessian import PLY_COLUMNS, vertex_columns
from iriftrace.medium.shells.stack import Shell, ShellStack
from iriftrace.medium.shells.table import SCHEMA, AirStatement, PartOrigin

if TYPE_CHECKING:
    from iriftrace.medium.shells.report import ShellReport


TABLE = "shells.json"
PARAVIEW = "shells.vtm"

_AGAIN = "write the shells again, or use import_shells for surfaces from elsewhere"
_NORMAL = ("nx", "ny", "nz")
_DERIVATIVES = tuple(f"{name}_{k + 1}" for name, n in PLY_COLUMNS.items() for k in range(n))


def save_shells(
    stack: ShellStack,
    directory: str | Path,
    report: Sequence[ShellReport] | None = None,
    *,
    notes: Mapping[str, str] | None = None,
    paraview: bool = True,
    part: PartOrigin | None = None,
) -> list[Path]:
    """Write a stack of shells into a folder, which is made if it is missing.

    The files, which are returned, are ``shell_01.ply`` and so on (numbered by layer, outermost
    first), ``shells.vtm`` for ParaView (which doubles the size) and ``shells.json``. Each is
    complete or absent; the table comes last. Files of an earlier stack with more shells are
    removed.

    The table also keeps the numbers of a report, `notes` on the field, such as ``{"time":
    "snapshot"}``, and the part of the scene that the shells are written for, its file as seen from
    there. Raises InputError if the folder cannot be made, or the report belongs to other shells.
    """
    if report is not None and [r.layer for r in report] != [s.layer for s in stack.shells]:
        raise InputError(
            "The report does not list the shells of this stack; report on it again.",
            code="shells.report",
        )
    folder = Path(directory)
    make_folder(folder)
    written = [folder / f"{_stem(shell)}.ply" for shell in stack.shells]
    for path, shell in zip(written, stack.shells, strict=True):
        write_shell(path, shell.vertices, shell.faces, shell.normals, shell.derivatives)
    if paraview:
        written.append(_write_paraview(folder, stack))
    remove_stale(folder, stack, paraview)
    stated = stack.stated(notes or {})
    rows = tuple(
        evolve(row, file=path.name, sha256=sha256_of(path))
        for path, row in zip(written, stated.shells, strict=False)
    )
    if part is not None:
        part = evolve(part, file=seen_from(folder, part.file))
    table = plain(evolve(stated, shells=rows, part=part))
    for row, found in zip(table["shells"], report or (), strict=False):
        row |= found.as_dict()
    write_json(folder / TABLE, table)
    return [*written, folder / TABLE]


def load_shells(folder: str | Path) -> ShellStack:
    """Read the shells of a scene, or those that ``iriftrace shells`` wrote.

    Parameters
    ----------
    folder : path
        The shells' folder, the folder of a scene with them, or the table ``shells.json`` itself.

    Raises
    ------
    InputError
        The table or a mesh is missing, damaged or of another kind.
    """
    path = Path(folder)
    if path.name != TABLE:
        path /= TABLE
    if not path.is_file() and (path.parent / "shells" / TABLE).is_file():
        path = path.parent / "shells" / TABLE
    check_exists(path, "give a folder that `iriftrace shells` wrote")
    stated = read_json(path, AirStatement, SCHEMA, _AGAIN)
    if stated.air is None or stated.rule is None:
        raise damaged(path, "it states no air or no rule", _AGAIN)
    shells = [
        Shell(row.layer, row.refractivity, row.ext, row.int_, *read_shell(path.parent / row.file))
        for row in stated.shells
    ]
    return ShellStack(shells, stated.air, stated.rule, stated.source, stated.small_components)


def _stem(shell: Shell) -> str:
    return f"shell_{shell.layer:02d}"


def write_shell(
    path: str | Path,
    vertices: Float32Array,
    faces: AnyIntArray,
    normals: Float32Array | None = None,
    derivatives: Float32Array | None = None,
) -> None:
    """Write triangles as PLY: with normals, if given, and with them the index's derivatives."""
    names: tuple[str, ...] = () if normals is None else _NORMAL
    if normals is not None and derivatives is not None:
        names += _DERIVATIVES
    columns = np.hstack(list(vertex_columns(normals, derivatives).values())).T if names else ()
    further = dict(zip(names, columns, strict=True)) if names else None
    ply.write_ply(path, vertices, faces, comments=["iriftrace shell, mm"], vertex_columns=further)


def read_shell(
    path: str | Path,
) -> tuple[Float32Array, AnyIntArray, Float32Array | None, Float32Array | None]:
    """Vertices, faces, normals and derivatives (or None) of a PLY of :func:`write_shell`."""
    path = Path(path)
    check_exists(path, _AGAIN)
    mesh = ply.read_whole_ply(path, _AGAIN)
    names = tuple(mesh.vertex_columns)[3:]
    if names not in ((), _NORMAL, _NORMAL + _DERIVATIVES):
        raise damaged(path, "its columns are not those of a shell", _AGAIN)
    vertices, faces = mesh.vertices.astype(np.float32), mesh.faces.astype(np.int32)
    if not names:
        return vertices, faces, None, None
    columns = np.stack([mesh.vertex_columns[name] for name in names], axis=1)
    if names == _NORMAL:
        return vertices, faces, columns, None
    length = np.linalg.norm(columns[:, 3:6], axis=1, keepdims=True)
    return vertices, faces, columns[:, :3], np.hstack((length, columns[:, 6:]))


def _write_paraview(folder: Path, stack: ShellStack) -> Path:
    """A multi-block file that ParaView opens, and its pieces in a folder of the same name."""
    target = folder / PARAVIEW
    pieces = folder / target.stem
    pieces.mkdir(exist_ok=True)
    lines = [
        '<?xml version="1.0"?>',
        '<VTKFile type="vtkMultiBlockDataSet" version="1.0" byte_order="LittleEndian">',
        "  <vtkMultiBlockDataSet>",
    ]
    for i, (shell, temperature) in enumerate(zip(stack.shells, stack.temperature_k, strict=True)):
        mesh = polydata(shell.vertices, shell.faces)
        if shell.normals is not None:
            mesh.point_data["Normals"] = shell.normals
        if shell.derivatives is not None:
            mesh.point_data["gradient_magnitude_1_mm"] = shell.derivatives[:, 0]
            mesh.point_data["hessian_1_mm2"] = shell.derivatives[:, 1:]
        count = mesh.n_cells
        mesh.cell_data["layer"] = np.full(count, shell.layer, dtype=np.int32)
        mesh.cell_data["refractivity"] = np.full(count, shell.refractivity)
        mesh.cell_data["temperature_k"] = np.full(count, temperature)
        name = _stem(shell)
        write_vtk(pieces / f"{name}.vtp", mesh, fast=True)
        file = quoteattr(f"{pieces.name}/{name}.vtp")
        lines.append(f'    <DataSet index="{i}" name="{name}" file={file}/>')
    lines += ["  </vtkMultiBlockDataSet>", "</VTKFile>"]
    write_whole(target, "\n".join(lines) + "\n")
    return target


def remove_stale(folder: Path, stack: ShellStack, paraview: bool) -> None:
    """Remove the files of an earlier stack in a folder, which could be mistaken for this one's."""
    stems = {_stem(shell) for shell in stack.shells}
    for path in folder.glob("shell_*.ply"):
        if path.stem not in stems:
            path.unlink()
    for path in folder.glob("shells/shell_*.vtp"):
        if path.stem not in stems or not paraview:
            path.unlink()
    if not paraview:
        (folder / PARAVIEW).unlink(missing_ok=True)
