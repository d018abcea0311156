"""A Mitsuba scene from objects in memory, equal to the scene that Mitsuba loads from its files.

The numbers in a scene's files are rounded: meshes to single precision, poses to 12 decimals.
`kept_part` and `kept_camera` round in the same manner, so that results do not depend on where a
scene comes from.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import Float32Array, FloatArray
from iriftrace.core.errors import without_warnings
from iriftrace.medium.shells.hessian import vertex_columns
from iriftrace.part.part import Part, part_of_mesh
from iriftrace.part.regions import Regions

if TYPE_CHECKING:
    import mitsuba as mi

    from iriftrace.medium.shells.stack import Shell, ShellStack


def kept_part(part: Part) -> Part:
    """A part as its file in a scene's folder stores it: vertices in single precision."""
    with without_warnings():
        # Warnings about the part's own file were issued when that was read.
        return part_of_mesh(
            part.vertices.astype(np.float32),
            part.faces,
            name=part.path,
            sha256=part.sha256,
            length_unit=part.length_unit,
            regions=Regions(part.region_of_face, part.region_names),
        )


def lookat(camera: Camera) -> dict[str, list[float]]:
    """Origin, target and up of a camera, as in a scene's file (``lookat``).

    Rounded to far below what matters, so that an edited file shows 0 and not 1e-14.
    """
    distance = max(1.0, float(np.linalg.norm(camera.origin)))
    vectors = {
        "origin": camera.origin,
        "target": camera.origin + distance * camera.forward,
        "up": -camera.matrix[:3, 1],
    }
    return {
        name: [round(float(value), 12) + 0.0 for value in vector]
        for name, vector in vectors.items()
    }


def kept_camera(camera: Camera) -> Camera:
    """A camera with the pose that its ``lookat`` in a scene's file gives."""
    return camera if camera.projection != "pinhole" else camera.at(_matrix_of(lookat(camera)))


def _matrix_of(pose: dict[str, list[float]]) -> FloatArray:
    """Camera-to-world matrix (4, 4) that Mitsuba computes from a ``lookat``."""
    import mitsuba as mi

    from iriftrace.plugins.kernels.projection import flip_axes

    matrix = np.array(mi.ScalarTransform4d().look_at(**pose).matrix, dtype=np.float64)
    return np.asarray(flip_axes(matrix), dtype=np.float64)


def mitsuba_scene(
    part: Part,
    shells: ShellStack,
    devices: Mapping[str, Camera],
    *,
    normals: str,
    blockers: Sequence[Part] = (),
) -> mi.Scene:
    """A scene of a part, shells, devices by their ids, and bodies that only block the view.

    `normals` is a parameter of ``first_hit``.
    """
    import mitsuba as mi

    from iriftrace.plugins.calibrated_camera import sensor_of

    scene: mi.Scene = mi.load_dict(
        {
            "type": "scene",
            "embree_use_robust_intersections": True,
            "integrator": {"type": "first_hit", "normals": normals},
            **{name: sensor_of(camera) for name, camera in devices.items()},
            "part": _body("part", part),
            **{f"blocker_{k}": _body(f"blocker_{k}", body) for k, body in enumerate(blockers, 1)},
            **{f"shell_{shell.layer:02d}": _shell(shell) for shell in shells.shells},
        },
        optimize=False,
    )
    return scene


def _body(name: str, body: Part) -> mi.Mesh:
    return _mesh(name, {"type": "diffuse"}, body.vertices, body.faces, {})


def _shell(shell: Shell) -> mi.Mesh:
    """The mesh of a shell, with the derivatives of the index if it has them."""
    return _mesh(
        f"shell_{shell.layer:02d}",
        {"type": "iso_shell", **iso_shell_indices(shell), "layer": str(shell.layer)},
        shell.vertices,
        shell.faces,
        vertex_columns(shell.normals, shell.derivatives),
    )


def iso_shell_indices(shell: Shell) -> dict[str, float]:
    """Refractive indices of a shell, by the names of the parameters of ``iso_shell``."""
    on_it = {"iso_ior": float(1 + shell.refractivity)} if shell.off_the_middle else {}
    return {"ext_ior": float(1 + shell.ext), "int_ior": float(1 + shell.int_), **on_it}


def _mesh(
    name: str,
    bsdf: dict[str, object],
    vertices: NDArray[np.floating],
    faces: NDArray[np.integer],
    columns: dict[str, Float32Array],
) -> mi.Mesh:
    """A mesh with values at its vertices; with the normals of its triangles if there are none."""
    import mitsuba as mi

    normals = columns.pop("normal", None)
    properties = mi.Properties()
    properties.set_id(name)
    properties["mesh_bsdf"] = mi.load_dict(bsdf)
    properties["face_normals"] = normals is None
    mesh = mi.Mesh(
        name, len(vertices), len(faces), properties, has_vertex_normals=normals is not None
    )
    values = mi.traverse(mesh)
    values["vertex_positions"] = mi.Float(np.float32(vertices).ravel())
    values["faces"] = mi.UInt32(faces.astype(np.uint32).ravel())
    if normals is not None:
        values["vertex_normals"] = mi.Float(normals.ravel())
    values.update()
    for column, numbers in columns.items():
        flat: Any = mi.Float(numbers.ravel())
        mesh.add_attribute(f"vertex_{column}", numbers.shape[1], flat)
    return mesh
