"""Small scenes for plain Mitsuba: meshes written as PLY, assembled from dictionaries.

Knows nothing of iriftrace's own scene folders, so that the plugins are tested as a Mitsuba user
meets them.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from iriftrace.image.aov_image import CHANNELS
from iriftrace.io.shells import write_shell

AMBIENT, HOT = 1.000272, 1.000172


def sphere(radius: float, subdivisions: int = 3) -> trimesh.Trimesh:
    """An icosphere about the origin whose vertex normals are exactly radial."""
    return trimesh.creation.icosphere(subdivisions, radius)


def ply(
    path: Path, mesh: trimesh.Trimesh, normals: np.ndarray | None = None, **more: Any
) -> dict[str, Any]:
    """Write a mesh; returns the dictionary of the shape that reads it."""
    write_shell(
        path,
        np.asarray(mesh.vertices, dtype=np.float32),
        np.asarray(mesh.faces, dtype=np.int32),
        None if normals is None else np.asarray(normals, dtype=np.float32),
    )
    return {"type": "ply", "filename": str(path), **more}


def part(folder: Path, mesh: trimesh.Trimesh, **more: Any) -> dict[str, Any]:
    """The dictionary of an opaque mesh."""
    return ply(
        folder / "part.ply", mesh, face_normals=True, **{"bsdf": {"type": "diffuse"}, **more}
    )


def shell(
    folder: Path,
    name: str,
    mesh: trimesh.Trimesh,
    ext_ior: float,
    int_ior: float,
    normals: np.ndarray | None = None,
    **more: Any,
) -> dict[str, Any]:
    """The dictionary of a shell; facet normals unless vertex normals are given."""
    return ply(
        folder / f"{name}.ply",
        mesh,
        normals,
        bsdf={"type": "iso_shell", "ext_ior": ext_ior, "int_ior": int_ior, "layer": name},
        **({} if normals is not None else {"face_normals": True}),
        **more,
    )


def nested_spheres(
    folder: Path, radii: tuple[float, ...], indices: tuple[float, ...], subdivisions: int = 3
) -> dict[str, Any]:
    """Closed spherical shells with radial normals, outermost first; one index more than radii."""
    shapes = {}
    for k, radius in enumerate(radii):
        mesh = sphere(radius, subdivisions)
        shapes[f"shell_{k + 1}"] = shell(
            folder, f"shell_{k + 1}", mesh, indices[k], indices[k + 1], mesh.vertices / radius
        )
    return shapes


def ball_in_shells(folder: Path) -> dict[str, Any]:
    """A ball of 10 mm in three closed shells of hot air."""
    indices = (1.000272, 1.00024, 1.00021, 1.00018)
    return {
        "part": part(folder, sphere(10.0)),
        **nested_spheres(folder, (20.0, 16.0, 13.0), indices),
    }


def film(width: int = 48, height: int = 40, **more: Any) -> dict[str, Any]:
    """The film that first_hit needs."""
    return {
        "type": "hdrfilm",
        "width": width,
        "height": height,
        "pixel_format": "luminance",
        "component_format": "float32",
        "rfilter": {"type": "box"},
        **more,
    }


def camera(
    origin: tuple[float, float, float] = (0.0, -100.0, 0.0),
    target: tuple[float, float, float] = (0.0, 0.0, 0.0),
    *,
    film: dict[str, Any] | None = None,
    **more: Any,
) -> dict[str, Any]:
    """A calibrated camera that sees +-30 mm at 100 mm."""
    import mitsuba as mi

    return {
        "type": "calibrated_camera",
        "focal_length": 10.0,
        "sensor_width": 6.0,
        "sensor_height": 5.0,
        "to_world": mi.ScalarTransform4d().look_at(origin, target, [0, 0, 1]),
        "film": film or globals()["film"](),
        **more,
    }


def scene(shapes: dict[str, Any], sensor: Any = None, **integrator: Any) -> Any:
    """A Mitsuba scene with first_hit, robust ray queries and unmerged shapes."""
    import mitsuba as mi

    return mi.load_dict(
        {
            "type": "scene",
            "embree_use_robust_intersections": True,
            "integrator": {"type": "first_hit", **integrator},
            "sensor": camera() if sensor is None else sensor,
            **shapes,
        },
        optimize=False,
    )


def channels(loaded: Any) -> dict[str, np.ndarray]:
    """All channels of a scene's picture, (h, w) float32 each."""
    tensor, _ = loaded.integrator().image(loaded, loaded.sensors()[0])
    return dict(zip(CHANNELS, np.array(tensor), strict=True))


def vector(pixels: dict[str, np.ndarray], name: str) -> np.ndarray:
    """(h, w, 3) float64 array of one of the channels' vectors."""
    return np.stack([pixels[f"{name}.{axis}"] for axis in "XYZ"], axis=-1).astype(np.float64)
