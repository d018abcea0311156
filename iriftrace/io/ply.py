"""Triangle meshes and points as PLY files, with columns of numbers at vertices and faces."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from attrs import frozen
from numpy.typing import ArrayLike

from iriftrace.core.arrays import AnyArray, AnyIntArray, FloatArray, IntArray
from iriftrace.core.blocks import CloudBlocks, blocks
from iriftrace.core.files import whole_file
from iriftrace.core.plain import JsonObject
from iriftrace.io.refusals import damaged


@frozen(eq=False)
class PlyMesh:
    """A mesh as stored in its file: (n, 3) vertices, (m, 3) faces, further columns by name.

    If the file's faces are not all triangles, their columns are longer or shorter than `faces`.
    Remarks are the header's lines ``obj_info``.
    """

    vertices: FloatArray
    faces: IntArray
    vertex_columns: dict[str, AnyArray]
    face_columns: dict[str, AnyArray]
    remarks: tuple[str, ...] = ()


def read_whole_ply(path: Path, remedy: str) -> PlyMesh:
    """Read a PLY file as `read_ply` does; InputError with a remedy if it is damaged."""
    try:
        return read_ply(path)
    except Exception as error:  # the reader lets any error through that a damaged file causes
        raise damaged(path, error, remedy) from error


def read_ply(path: Path) -> PlyMesh:
    """Read a PLY file of any program; polygons are split into triangles.

    A damaged file raises the errors of trimesh's reader, or ValueError.
    """
    head, rows = _checked_header(path)
    header = head.decode("utf-8", "replace").splitlines()
    # Imported when needed, because writing a mesh needs no reader.
    import trimesh

    # Without processing, the order of the faces is that of the file and of Mitsuba.
    plain_head = _CAPITAL_AXIS.sub(lambda axis: axis[0].lower(), head)
    # Comments of Windows programs need not be UTF-8, which trimesh expects.
    plain_head = plain_head.decode("ascii", "replace").replace("\ufffd", "?").encode()
    with path.open("rb") as file:
        data = file if plain_head == head else io.BytesIO(plain_head + file.read()[len(head) :])
        # Without textures, whose seams would double vertices and whose pictures may be missing.
        mesh = trimesh.load(
            data, file_type="ply", process=False, skip_materials=True, fix_texture=False
        )
    raw = mesh.metadata.get("_ply_raw", {})
    # A file of no vertices is an empty scene to trimesh.
    vertices = np.asarray(getattr(mesh, "vertices", ()), dtype=np.float64).reshape(-1, 3)
    stated = rows.get(b"vertex", 0)
    if len(vertices) != stated:
        raise ValueError(f"its header states {stated:,} vertices, and it has {len(vertices):,}")
    faces = np.asarray(getattr(mesh, "faces", ()), dtype=np.int64)
    check_corners(vertices, faces)
    return PlyMesh(
        vertices,
        faces,
        _columns(raw, "vertex"),
        _columns(raw, "face"),
        tuple(line for line in header if line.startswith("obj_info ")),
    )


def check_corners(vertices: FloatArray, faces: IntArray) -> None:
    """Check that these are triangles between existing vertices; raises ValueError otherwise."""
    if faces.size == 0:
        return
    if vertices.shape[1:] != (3,) or faces.shape[1:] != (3,):
        raise ValueError(f"vertices {vertices.shape} and faces {faces.shape} are not triangles")
    lowest, highest = int(faces.min()), int(faces.max())
    if lowest < 0 or highest >= len(vertices):
        wrong = lowest if lowest < 0 else highest
        raise ValueError(f"a triangle names vertex {wrong}, but there are {len(vertices)}")


def _checked_header(path: Path) -> tuple[bytes, dict[bytes, int]]:
    """The header, and the number of rows that it states of each element.

    A ValueError if it states more than the file has, which readers make room for; or, in a file of
    text, other rows: readers count from the beginning, so a point too few or too many makes points
    of faces.
    """
    with path.open("rb") as file:
        head, end, _ = file.read(HEADER_LIMIT).partition(b"end_header")
        if not end:
            raise ValueError("its header has no end")
        rows: dict[bytes, int] = {}
        least, count, text = 0, 0, False
        for line in head.splitlines():
            match line.split():
                case [b"format", kind, *_]:
                    text = kind == b"ascii"
                case [b"element", name, number]:
                    count = rows[name] = int(number)
                case [b"property", b"list", kind, *_] | [b"property", kind, _]:
                    # A digit and what separates it from the next.
                    least += count * (2 if text else _BYTES.get(kind, 1))
        size = path.stat().st_size
        if least > size:
            raise ValueError(f"its header states at least {least:,} bytes, and it has {size:,}")
        file.seek(len(head))
        stated = sum(rows.values())
        if text and stated != (there := sum(bool(line.strip()) for line in file) - 1):
            raise ValueError(f"its header states {stated:,} rows, and it has {there:,}")
    return head, rows


HEADER_LIMIT = 1_000_000
"""Bytes in which a header ends, comments included."""

_CAPITAL_AXIS = re.compile(rb"(?m)^property[ \t]+\w+[ \t]+[XYZ][ \t\r]*$")
"""Coordinates by names that some programs write and few readers know."""

_BYTES = {
    **dict.fromkeys((b"short", b"ushort", b"int16", b"uint16"), 2),
    **dict.fromkeys((b"int", b"uint", b"float", b"int32", b"uint32", b"float32"), 4),
    **dict.fromkeys((b"double", b"float64"), 8),
}


def _columns(raw: JsonObject, element: str) -> dict[str, AnyArray]:
    """Columns of numbers: an array with fields of a binary file, a dictionary of one of text."""
    data = raw.get(element, {}).get("data")
    if data is None:
        return {}
    names = (data.dtype.names or ()) if isinstance(data, np.ndarray) else data.keys()
    columns = {name: np.asarray(data[name]) for name in names}
    return {name: column.ravel() for name, column in columns.items() if column.dtype.kind in "iuf"}


def write_ply(
    path: str | Path,
    vertices: ArrayLike,
    faces: AnyIntArray,
    *,
    comments: Sequence[str] = (),
    vertex_columns: Mapping[str, ArrayLike] | None = None,
    face_columns: Mapping[str, ArrayLike] | None = None,
) -> None:
    """Write triangles as binary little-endian PLY, as float32 and with 16-bit corners if possible.

    Vertices are (n, 3), mm, faces (m, 3) vertex numbers; comments are lines of the header, columns
    further numbers of each vertex and face, by name. The file's folder must exist.
    """
    points = dict(zip("xyz", np.transpose(vertices), strict=True)) | dict(vertex_columns or {})
    further = dict(face_columns or {})
    count = len(np.asarray(vertices))
    ply_corner, corner = ("ushort", "<u2") if count <= 1 << 16 else ("int", "<i4")
    header = [
        *(f"comment {comment}" for comment in comments),
        f"element vertex {count}",
        *(f"property float {name}" for name in points),
        f"element face {len(faces)}",
        f"property list uchar {ply_corner} vertex_indices",
        *(f"property float {name}" for name in further),
    ]
    columns = [(name, "<f4") for name in further]
    rows = np.empty(len(faces), dtype=[("count", "u1"), ("corners", corner, 3), *columns])
    rows["count"], rows["corners"] = 3, faces
    for name, column in further.items():
        rows[name] = column
    places = np.column_stack(list(points.values())).astype("<f4")
    _write(path, header, lambda: places, lambda: rows)


def write_ply_points(
    path: str | Path,
    points: FloatArray,
    columns: Mapping[str, AnyArray],
    *,
    comments: Sequence[str] = (),
    remarks: Sequence[str] = (),
) -> None:
    """Write (n, 3) points as binary little-endian PLY, their places in double precision.

    The columns of float64 are ``double``, those of float32 ``float``, bytes ``uchar``, other whole
    numbers ``int``; blanks in their names become ``_``, and what is not ASCII question marks.
    `remarks` are whole lines of the header, as `PlyMesh` has them.
    """
    rows = CloudBlocks.of_arrays(points, columns)
    write_ply_blocks(path, rows, comments=comments, remarks=remarks)


def write_ply_blocks(
    path: str | Path,
    cloud: CloudBlocks,
    *,
    comments: Sequence[str] = (),
    remarks: Sequence[str] = (),
) -> None:
    """Write the rows of a cloud in the same way."""

    def named(rows: slice) -> dict[str, AnyArray]:
        points, columns = cloud.of(rows)
        further = {"_".join(name.split()): values for name, values in columns.items()}
        return dict(zip("xyz", np.transpose(points), strict=True)) | further

    kinds = {name: _kind(values) for name, values in named(slice(0, 0)).items()}
    header = [
        *(f"comment {comment}" for comment in comments),
        *remarks,
        f"element vertex {cloud.count}",
        *(f"property {_PROPERTY[kind]} {name}" for name, kind in kinds.items()),
    ]

    def table(rows: slice) -> AnyArray:
        values = named(rows)
        found = np.empty(rows.stop - rows.start, dtype=list(kinds.items()))
        for name, column in values.items():
            found[name] = column
        return found

    header = [line.encode("ascii", "replace").decode() for line in header]
    _write(path, header, *(partial(table, rows) for rows in blocks(cloud.count)))


def _write(path: str | Path, header: Sequence[str], *tables: Callable[[], AnyArray]) -> None:
    lines = ("ply", "format binary_little_endian 1.0", *header, "end_header\n")
    with whole_file(path) as temporary, temporary.open("wb") as file:
        file.write("\n".join(lines).encode())
        for table in tables:
            file.write(table().tobytes())


_PROPERTY = {"<f8": "double", "<f4": "float", "<i4": "int", "u1": "uchar"}
"""Words of PLY for kinds of numbers."""


def _kind(values: AnyArray) -> str:
    if values.dtype == np.uint8:
        return "u1"
    if values.dtype.kind in "iub":
        return "<i4"
    return "<f4" if values.dtype == np.float32 else "<f8"
