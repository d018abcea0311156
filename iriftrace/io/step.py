"""Parts in STEP files (ISO 10303-21), meshed by Open CASCADE in a child process."""

from __future__ import annotations

import io
from importlib.util import find_spec
from pathlib import Path
from typing import Literal

import numpy as np

from iriftrace.core.arrays import AnyArray, FloatArray, IntArray
from iriftrace.core.errors import InputError
from iriftrace.core.isolated import ChildError, read_in_child
from iriftrace.io.refusals import damaged

SUFFIXES = (".step", ".stp")

_KINDS: set[Literal["plane", "cylinder", "cone", "sphere", "torus"]] = {
    "plane",
    "cylinder",
    "cone",
    "sphere",
    "torus",
}
_SMALLEST, _WORK = 60_000_000, 50
"""Bytes of a mesh that take as long as meshing any STEP file, and each byte of one."""
_MM = 1000.0
_DIGITS = 9
"""Digits of a metre by which parameters of surfaces are compared."""


def read_step(path: Path, chord_mm: float) -> tuple[FloatArray, IntArray, IntArray]:
    """Mesh a STEP file: vertices (n, 3), mm, faces (m, 3), and each face's surface (m,).

    No triangle is farther than `chord_mm`, mm, from its surface. Faces of the file on one plane,
    cylinder, cone, sphere or torus, such as the halves of a bore, have the same surface.
    """
    if not 0.0 < chord_mm < np.inf:
        raise InputError(
            f"a chord error of {chord_mm:g} mm cannot be met; give a positive one.",
            code="part.chord_error",
            argument="chord_error",
        )
    if find_spec("cascadio") is None:
        script = (
            f"MeshPart.meshFromShape(Shape=Part.read({path.name!r}), "
            f"LinearDeflection={chord_mm:g}, AngularDeflection=0.5).write('part.stl')"
        )
        raise InputError(
            f"{path} is a STEP file, which needs cascadio: pip install 'iriftrace[cad]'; or mesh "
            f"it with a chord error of {chord_mm:g} mm: gmsh -2 -setnumber "
            f'Mesh.MeshSizeFromCurvature 200 "{path.name}" -o part.stl, or in FreeCAD\'s console '
            f"import Part, MeshPart; {script}.",
            code="file.no_library",
        )
    size = _SMALLEST + _WORK * path.stat().st_size
    try:
        found = read_in_child(f"{__name__}:mesh_step", size, str(path), chord_mm)
    except ChildError as error:
        remedy = "export it again as a solid (AP214 or AP242)"
        raise damaged(path, error, remedy) from error
    return found["vertices"], found["faces"], found["surfaces"]


def mesh_step(path: str, chord_mm: float) -> dict[str, AnyArray]:
    """Arrays of `read_step`; in the child."""
    import cascadio
    import trimesh

    content = cascadio.load(
        Path(path).read_bytes(),
        file_type="step",
        tol_linear=chord_mm,
        include_brep=True,
        brep_types=_KINDS,
    )
    if not content:
        raise ValueError("it has no solid that could be meshed")
    scene = trimesh.load_scene(io.BytesIO(content), file_type="glb", process=False)
    vertices, faces, surfaces = [], [], []
    points, number = 0, 0
    for node in scene.graph.nodes_geometry:
        motion, name = scene.graph[node]
        body = scene.geometry[name]
        own = _surfaces(body.metadata["cascadio"]["brep_faces"])
        vertices.append(trimesh.transform_points(body.vertices, motion) * _MM)
        faces.append(np.asarray(body.faces) + points)
        surfaces.append(own[body.face_attributes["brep_index"]] + number)
        points, number = points + len(body.vertices), number + len(own)
    return {
        "vertices": np.concatenate(vertices),
        "faces": np.concatenate(faces).astype(np.int64),
        "surfaces": np.concatenate(surfaces).astype(np.int64),
    }


def _surfaces(faces: list[dict[str, object] | None]) -> IntArray:
    """Number of each face's surface, the same for faces whose surfaces have the same parameters."""
    numbers: dict[object, int] = {}
    return np.array(
        [
            numbers.setdefault(number if face is None else _parameters(face), number)
            for number, face in enumerate(faces)
        ],
        dtype=np.int64,
    )


def _parameters(face: dict[str, object]) -> tuple[object, ...]:
    """Kind and parameters of a surface, without those by which it is cut out."""
    kind = str(face["type"])
    numbers = {
        name: np.asarray(value, dtype=np.float64)
        for name, value in face.items()
        if name not in ("type", "face_index") and not name.startswith(("extent", "x_dir"))
    }
    if kind == "plane":
        numbers["origin"] = numbers["normal"] * (numbers["normal"] @ numbers["origin"])
    elif kind == "cylinder":
        # The place on the axis next to the origin, whichever way the axis points.
        axis = numbers["axis"]
        axis = axis * np.sign(axis[np.argmax(np.abs(axis) > 0.1)])
        numbers["axis"] = axis
        numbers["origin"] = numbers["origin"] - axis * (axis @ numbers["origin"])
    return kind, *(
        tuple(np.ravel(np.round(value, _DIGITS) + 0.0).tolist())
        for _, value in sorted(numbers.items())
    )
