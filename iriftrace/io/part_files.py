"""Part meshes on disk: all formats of trimesh, and PLY files with named face regions."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh
from attrs import evolve, frozen

from iriftrace.core.arrays import AnyArray, FloatArray, IntArray
from iriftrace.core.errors import InputError
from iriftrace.core.files import sha256_of, whole_file
from iriftrace.core.mesh.transform import apply
from iriftrace.core.units import LENGTH_UNITS, length_factor, length_unit_of
from iriftrace.io.ply import HEADER_LIMIT, PlyMesh, check_corners, read_ply, write_ply
from iriftrace.io.reading import AS_DRAWN, ReadPart
from iriftrace.io.refusals import check_exists, damaged, not_read
from iriftrace.io.step import SUFFIXES, read_step
from iriftrace.part.growth import Growth
from iriftrace.part.part import Part, part_of_mesh
from iriftrace.part.regions import Regions
from iriftrace.part.soundness import check_unit, stated_growth
from iriftrace.part.uneven_growth import Temperatures, grown_unevenly

# Mitsuba reads face properties only with a number at the end, and calls this one ``face_region``;
# for any other name it prints a warning. It scales integers by their range, hence float.
_WRITTEN_PROPERTY = "region_0"
_READ_PROPERTIES = ("region", _WRITTEN_PROPERTY)
_DRAWING = ("drawing_1", "drawing_2", "drawing_3")
_DECIMAL_COMMA = re.compile(rb"^\s*(?:vertex|v)\s+[-+]?\d+,\d", re.MULTILINE)
_REQUIRED = re.compile(rb'"extensionsRequired"\s*:\s*\[([^\]]*)\]')
_OF_SHAPES = re.compile(rb'"(?!KHR_(?:materials|texture)|EXT_texture)(\w+)"')
"""Extensions of glTF besides those of colours."""

_REGION_COMMENT = re.compile(r"comment\s+region\s+(-?\d+)\s+(.*\S)\s*")

LARGEST_REGION = 2**31
"""Regions have numbers below this; larger values are not regions."""

WRITTEN_SUFFIXES = (".ply", ".stl")


@frozen(eq=False)
class MeshFile:
    """One triangle mesh as stored in its file."""

    vertices: FloatArray  # (n, 3)
    faces: IntArray  # (m, 3), in the file's order
    regions: Regions | None
    unit: str | None  # of length, if the file declares one
    sha256: str
    growth: Growth | None = None
    drawing: FloatArray | None = None  # (n, 3), vertices of the cold part in the file's unit
    surfaces: IntArray | None = None  # (m,), number of the CAD surface on which each face lies


def load_mesh_file(path: Path, chord_mm: float) -> MeshFile:
    """Read a mesh file; the parts of a scene (``.glb``) are combined, a STEP file is meshed."""
    check_exists(path, "give an existing mesh")
    if path.suffix.lower() in SUFFIXES:
        vertices, faces, surfaces = read_step(path, chord_mm)
        return MeshFile(vertices, faces, None, "mm", sha256_of(path), surfaces=surfaces)
    suffix = path.suffix.removeprefix(".").lower()
    with path.open("rb") as file:
        packed = file.read(4).startswith((b"\x1f\x8b", b"BZh", b"PK\x03\x04"))
    if packed and suffix != "3mf":
        raise InputError(
            f"{path} is packed (gzip, bzip2 or zip); unpack it, and give the mesh in it.",
            code="file.packed",
        )
    if suffix not in trimesh.available_formats():
        install = "install lxml and networkx (pip install lxml networkx), or "
        raise InputError(
            f"{path} is of a format {suffix!r} that cannot be read; "
            f"{install if suffix == '3mf' else ''}convert it to PLY, STL, OBJ or GLB.",
            code="file.ending",
        )
    required = _REQUIRED.search(path.read_bytes()) if suffix in ("glb", "gltf") else None
    if required and (unread := _OF_SHAPES.search(required[1])):
        found = f"the extension {unread[1].decode()} of glTF"
        raise not_read(path, found, "export it without compression and instances")
    unit, region_columns, growth, drawing = None, [], None, None
    mesh: PlyMesh | trimesh.parent.Geometry
    try:
        if suffix == "ply":
            mesh = read_ply(path)
            growth = Growth.of_header(_header(path))
            drawing = _drawing(mesh)
            region_columns = [
                mesh.face_columns[name] for name in _READ_PROPERTIES if name in mesh.face_columns
            ]
        else:
            # Without processing, the order of the faces is that of the file.
            mesh = trimesh.load(path, process=False)
            unit = getattr(mesh, "units", None)
            mesh = mesh.to_mesh() if isinstance(mesh, trimesh.Scene) else mesh
    except Exception as error:  # its readers raise any error for a damaged file
        if _DECIMAL_COMMA.search(path.read_bytes()[:4096]):
            remedy = "export it with decimal points, or as a binary file"
            raise not_read(path, "decimal commas", remedy) from error
        raise damaged(path, error, "export it again, as triangles") from error
    faces = np.asarray(getattr(mesh, "faces", ()), dtype=np.int64)
    if faces.size == 0:
        raise damaged(path, "it has no triangles", "export the part's surface as triangles")
    vertices = np.array(getattr(mesh, "vertices", ()), dtype=np.float64)
    try:
        check_corners(vertices, faces)
    except ValueError as error:
        raise damaged(path, error) from error
    regions = _regions(path, region_columns[0], len(faces)) if region_columns else None
    unit = unit or length_unit_of(remarks_of(path), path.name) or None
    return MeshFile(vertices, faces, regions, unit, sha256_of(path), growth, drawing)


def remarks_of(path: Path) -> list[str]:
    """Comments at the beginning of a PLY, OBJ or OFF file, or the header of an STL."""
    match path.suffix.lower():
        case ".stl":
            with path.open("rb") as content:
                return [content.readline(80).decode("ascii", errors="replace")]
        case ".ply":
            return [line for line in _header(path) if line.startswith(("comment ", "obj_info "))]
        case ".obj" | ".off":
            with path.open(encoding="utf-8", errors="replace") as file:
                return [line for line in itertools.islice(file, 50) if line.startswith("#")]
    return []


def _drawing(mesh: PlyMesh) -> FloatArray | None:
    """Vertices (n, 3) of the cold part, if a file has them."""
    columns = [mesh.vertex_columns.get(name) for name in _DRAWING]
    if any(column is None or len(column) != len(mesh.vertices) for column in columns):
        return None
    found = np.column_stack(columns).astype(np.float64)  # type: ignore[arg-type]
    return found if np.isfinite(found).all() else None


def _header(path: Path) -> list[str]:
    """Lines of a PLY file's header."""
    with path.open("rb") as file:
        header = file.read(HEADER_LIMIT).partition(b"end_header")[0]
    return header.decode("utf-8", errors="replace").splitlines()


def _regions(path: Path, column: AnyArray, face_count: int) -> Regions:
    given = column.astype(np.float64)
    if not (np.abs(given) < LARGEST_REGION).all():
        raise damaged(path, f"a triangle's region is not a number below {LARGEST_REGION:,}")
    if len(given) != face_count:
        fault = f"it has {len(given)} region numbers for {face_count} triangles"
        raise damaged(path, fault, "export it as triangles or drop the regions")
    ids, of_face = np.unique(np.rint(given).astype(np.int64), return_inverse=True)
    matches = filter(None, map(_REGION_COMMENT.fullmatch, _header(path)))
    named = {int(match[1]): match[2] for match in matches}
    found = tuple(named.get(i, f"region {i}") for i in ids.tolist())
    if len(set(found)) < len(found):
        raise InputError(
            f"{path} gives one region name to several numbers: {', '.join(found)}; make the names "
            "in its comments unique.",
            code="region.twice",
        )
    return Regions(of_face.astype(np.int64), found)


def check_part_name(path: Path) -> None:
    """Refuse a file name without the suffix of a part's file."""
    if path.suffix.lower() not in WRITTEN_SUFFIXES:
        proposed = path.with_name((path.stem or "part") + ".ply")
        raise InputError(
            f"The output {path} must end in .ply, which keeps the named regions, or .stl; name it "
            f"{proposed}, for example.",
            code="file.ending",
            argument="output",
        )


def write_mesh_file(
    path: Path,
    vertices: FloatArray,
    faces: IntArray,
    regions: Regions,
    growth: Growth | None = None,
    drawing: FloatArray | None = None,
) -> None:
    """Write a surface, mm: as PLY with a region for each face, or as STL without.

    Regions are the face property ``region_0`` (a float, so that Mitsuba reads it as the mesh
    attribute ``face_region``) and one comment ``region NUMBER NAME`` for each. The vertices of the
    cold part are the vertex properties ``drawing_1`` to ``drawing_3``. An STL of an expanded part
    is refused with an InputError, because it cannot state the expansion.
    """
    check_part_name(path)
    if path.suffix.lower() == ".stl":
        if growth is not None:
            raise InputError(
                f"{path} cannot state that the part is expanded, so it would be expanded again; "
                f"name it {path.with_suffix('.ply')}.",
                code="part.growth_not_written",
                argument="output",
            )
        mesh = trimesh.Trimesh(vertices, faces, process=False)
        with whole_file(path) as temporary:
            mesh.export(temporary, file_type="stl")
        return
    grown = [] if growth is None else [growth.comment()]
    names = [f"region {number} {name}" for number, name in enumerate(regions.names)]
    write_ply(
        path,
        vertices,
        faces,
        comments=["iriftrace part, millimetre", *grown, *names],
        vertex_columns={} if drawing is None else dict(zip(_DRAWING, drawing.T, strict=True)),
        face_columns={_WRITTEN_PROPERTY: regions.of_face},
    )


def read_part(
    path: str | Path,
    reading: ReadPart = AS_DRAWN,
    *,
    field_wall: Callable[[Part], Temperatures] | None = None,
) -> Part:
    """Read a part's surface, check it and find its regions.

    The coordinates are read in the part's length unit, then expanded about the file's origin, then
    transformed.

    Parameters
    ----------
    path
        A mesh that trimesh reads: PLY, STL, OBJ, OFF, GLB and others; or a STEP file.
    reading
        Unit, place and thermal expansion of the part.
    field_wall
        Returns the temperatures of the field's wall for the cold part; needed if the part's hot
        temperature is that of the field.

    Returns
    -------
    Part
        Regions come from the PLY face property ``region`` (or ``region_0``) with names from
        comments ``region NUMBER NAME``, from the surfaces of a STEP file, otherwise from smooth
        patches; `iriftrace.part.regions.name_regions` names both.

    Raises
    ------
    InputError
        The file cannot be used, or an argument is wrong.

    Warns
    -----
    IriftraceWarning
        The surface is not closed, was turned over, has triangles that lie on others, which are
        removed, or on their neighbours, is far from the origin, or its unit is doubtful.
    """
    path, length_unit, hot, transform = Path(path), reading.length_unit, reading.hot, reading.matrix
    if length_unit is not None:
        length_factor(length_unit)  # refuses an unknown unit before the file is read
        length_unit = LENGTH_UNITS.get(length_unit.casefold(), length_unit)
    if reading.expansion is None and reading.hot_temperature:
        raise InputError(
            "a hot temperature is given, by which the part expands only with its expansion; give "
            "that, such as 14e-6/K, or leave the temperature out for a part drawn hot.",
            code="part.no_expansion",
            argument="expansion",
        )
    file = load_mesh_file(path, reading.chord_error)
    growth, factor = stated_growth(
        str(path),
        file.growth,
        None if hot.uneven else reading.expansion,
        reading.reference_temperature,
        hot.default,
    )
    stated = file.unit and LENGTH_UNITS.get(file.unit, file.unit)
    length_unit = length_unit or stated or "mm"
    scale = length_factor(length_unit) * factor
    vertices = file.vertices * scale
    check_unit(str(path), vertices[file.faces.ravel()], stated or length_unit, length_unit)
    part = part_of_mesh(
        vertices,
        file.faces,
        name=str(path),
        sha256=file.sha256,
        length_unit=length_unit,
        regions=file.regions,
        surfaces=file.surfaces,
        transform=transform,
        region_angle_deg=reading.region_angle,
    )
    if reading.expansion is not None and hot.uneven:
        return grown_unevenly(
            evolve(part, growth=growth),
            reading.expansion,
            reading.reference_temperature,
            hot.at_walls(part, field_wall),
            (0.0, 0.0, 0.0) if transform is None else transform[:3, 3],
        )
    if growth is None or (file.drawing is None and transform is None):
        return evolve(part, growth=growth)
    drawing = vertices / growth.factor if file.drawing is None else file.drawing * scale
    if transform is not None:
        drawing = apply(transform, drawing)
    return evolve(part, growth=growth, drawing=drawing)


def save_part(part: Part, path: str | Path) -> None:
    """Write a part as binary PLY (float32, mm), or as STL, which many programs need.

    The PLY keeps the order of the faces and the regions: Mitsuba, trimesh and ParaView read the
    file, and `read_part` restores the regions.

    Raises
    ------
    InputError
        The name has another ending, the folder does not exist, or the part is expanded, which an
        STL cannot state.
    """
    regions = Regions(part.region_of_face, part.region_names)
    write_mesh_file(Path(path), part.vertices, part.faces, regions, part.growth, part.drawing)
