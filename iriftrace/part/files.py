"""Part meshes on disk: whatever trimesh reads, and PLY files that carry named face regions."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.errors import InputError
from iriftrace.core.files import sha256_of, whole_file
from iriftrace.geometry.ply import corner_type
from iriftrace.part.regions import Regions

# Mitsuba reads face properties only with a number at the end, and calls this one ``face_region``;
# for any other name it prints a warning. It scales integers by their range, hence float.
_WRITTEN_PROPERTY = "region_0"
_READ_PROPERTIES = ("region", _WRITTEN_PROPERTY)
_REGION_COMMENT = re.compile(r"comment\s+region\s+(-?\d+)\s+(.*\S)\s*")
_HEADER_LIMIT = 1_000_000

LARGEST_REGION = 2**31
"""Regions have numbers below this; what is larger is no region."""


@frozen(eq=False)
class MeshFile:
    """One triangle mesh as its file has it: (n, 3) vertices, (m, 3) faces in the file's order.

    `unit` is the length unit that the file itself declares, or None.
    """

    vertices: FloatArray
    faces: IntArray
    regions: Regions | None
    unit: str | None
    sha256: str


def load_mesh_file(path: Path) -> MeshFile:
    """Read a mesh file; the parts of a scene (``.glb``) are put together.

    Raises
    ------
    InputError
        The file is missing, of an unknown format, damaged or without triangles.
    """
    if not path.is_file():
        raise InputError(f"there is no part file {path}; give an existing mesh.")
    suffix = path.suffix.removeprefix(".").lower()
    import trimesh

    known = trimesh.available_formats()
    if suffix not in known:
        raise InputError(
            f"{path} is of a format {suffix!r} that cannot be read; convert it to "
            "PLY, STL, OBJ or GLB."
        )
    try:
        # Without processing, the order of the faces is that of the file and of Mitsuba.
        loaded: Any = trimesh.load(path, process=False)
        unit = getattr(loaded, "units", None)
        mesh = loaded.to_mesh() if isinstance(loaded, trimesh.Scene) else loaded
    except Exception as error:  # its readers let any error through that a damaged file causes
        raise InputError(f"{path} is damaged or no mesh ({error}); export it again.") from error
    faces = np.asarray(getattr(mesh, "faces", ()), dtype=np.int64)
    if faces.size == 0:
        raise InputError(
            f"{path} has no triangles or is damaged, so there is nothing to measure; export the "
            "part's surface as triangles."
        )
    vertices = np.array(mesh.vertices, dtype=np.float64)
    lowest, highest = int(faces.min()), int(faces.max())
    if lowest < 0 or highest >= len(vertices):
        wrong = lowest if lowest < 0 else highest
        raise InputError(
            f"{path} is damaged: a triangle names vertex {wrong}, but there are {len(vertices)}; "
            "export it again."
        )
    return MeshFile(
        vertices=vertices,
        faces=faces,
        regions=_regions(path, mesh, len(faces)),
        unit=unit,
        sha256=sha256_of(path),
    )


def _regions(path: Path, mesh: Any, face_count: int) -> Regions | None:
    data = mesh.metadata.get("_ply_raw", {}).get("face", {}).get("data")
    if data is None:
        return None
    present = data.dtype.names or () if isinstance(data, np.ndarray) else tuple(data)
    names = [name for name in _READ_PROPERTIES if name in present]
    if not names:
        return None
    given = np.asarray(data[names[0]], dtype=np.float64).ravel()
    if not (np.abs(given) < LARGEST_REGION).all():
        raise InputError(
            f"{path} is damaged: a triangle's region is no number below {LARGEST_REGION:,}; export "
            "it again."
        )
    numbers = np.rint(given).astype(np.int64)
    if len(numbers) != face_count:
        raise InputError(
            f"{path} has {len(numbers)} region numbers for {face_count} triangles, because some of "
            "its faces are not triangles; export it as triangles or drop the regions."
        )
    ids, of_face = np.unique(numbers, return_inverse=True)
    named = dict(_named_ids(path))
    found = tuple(named.get(int(i), f"region {i}") for i in ids)
    if len(set(found)) < len(found):
        raise InputError(
            f"{path} gives one region name to several numbers: {', '.join(found)}; "
            "make the names in its comments unique."
        )
    return Regions(of_face.astype(np.int64), found)


def _named_ids(path: Path) -> list[tuple[int, str]]:
    with path.open("rb") as file:
        header = file.read(_HEADER_LIMIT).partition(b"end_header")[0]
    lines = header.decode("utf-8", errors="replace").splitlines()
    matches = (_REGION_COMMENT.fullmatch(line) for line in lines)
    return [(int(match[1]), match[2]) for match in matches if match]


def write_ply(path: Path, vertices: FloatArray, faces: IntArray, regions: Regions) -> None:
    """Write a binary PLY with a region for each face.

    Parameters
    ----------
    path
        Name of the file; its folder must exist.
    vertices
        (n, 3) array, mm; written as float32.
    faces
        (m, 3) vertex numbers.
    regions
        Regions of the faces: face property ``region_0`` (a float, so that Mitsuba reads it as the
        mesh attribute ``face_region``) and one comment ``region NUMBER NAME`` for each.
    """
    comments = "".join(f"comment region {i} {name}\n" for i, name in enumerate(regions.names))
    kind = corner_type(len(vertices))
    header = (
        "ply\nformat binary_little_endian 1.0\ncomment iriftrace part, millimetre\n"
        f"{comments}"
        f"element vertex {len(vertices)}\n"
        "property float x\nproperty float y\nproperty float z\n"
        f"element face {len(faces)}\n"
        f"{kind.line}\n"
        f"property float {_WRITTEN_PROPERTY}\nend_header\n"
    )
    row = [("count", "u1"), ("vertices", kind.numpy, 3), ("region", "<f4")]
    rows = np.empty(len(faces), dtype=row)
    rows["count"] = 3
    rows["vertices"] = faces
    rows["region"] = regions.of_face
    with whole_file(path) as temporary, temporary.open("wb") as file:
        file.write(header.encode())
        file.write(vertices.astype("<f4").tobytes())
        file.write(rows.tobytes())
