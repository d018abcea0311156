"""One field through every reader: by how much the displacement maps differ."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pyvista as pv
from numpy.typing import NDArray

from iriftrace.camera.camera import Camera
from iriftrace.core.errors import IriftraceWarning
from iriftrace.core.units import ZERO_CELSIUS_K
from iriftrace.image.aov_image import AovImage, Status
from iriftrace.io.field import read_field
from iriftrace.io.part_files import read_part
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.shells.contour import contour_shells
from iriftrace.medium.tetrahedra import tetrahedra_of
from iriftrace.plugins.kernels.between import length_gain
from iriftrace.scenes import folder_of
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.pose_image import pose_image
from iriftrace.tracing.write import write_scene
from validation.field_files import comsol
from validation.field_files.openfoam import write_case
from validation.field_files.openfoam_mesh import Patch
from validation.inputs.cameras import camera_at
from validation.line import Line, Section

FloatArray = NDArray[np.float64]

LAYERS = 13
ORIGIN = np.array((0.0, -190.0, -120.0))
RANGE_MM = 60.0
"""Length of a ray before its hit in which there is hot air."""
STEP_MM = 0.25
SPACINGS_MM = (2.0, 1.0)
LARGEST_REST_PERCENT = 6.0
"""Largest part of the difference found by tracing that the fields' own line integrals leave
unexplained: half of the effect of the coarsest file's interpolation on the temperatures (12 %)."""


def air_around_the_middle() -> pv.UnstructuredGrid:
    """The bundled cylinder's field, 50 mm of its length, as it comes from the solver."""
    grid = pv.read(folder_of("cylinder") / "field.vtu")
    centres = np.abs(np.asarray(grid.cell_centers().points))
    kept = grid.extract_cells(np.flatnonzero((centres < (25.0, 40.0, 40.0)).all(axis=1)))
    bare = pv.UnstructuredGrid()
    bare.copy_structure(kept)
    bare.points = np.asarray(kept.points, dtype=np.float64)
    bare.point_data["T"] = np.asarray(kept.point_data["T"], dtype=np.float64)
    return bare


def write_all(folder: Path, spacings: Sequence[float] = SPACINGS_MM) -> dict[str, Path]:
    """The same field as several programs write it, by a name for each, the .vtu first."""
    grid = air_around_the_middle()
    kelvin = np.asarray(grid.point_data["T"])
    points = np.asarray(grid.points)
    folder.mkdir(parents=True, exist_ok=True)
    files = {".vtu": folder / "field.vtu"}
    grid.save(files[".vtu"])
    for spacing in spacings:
        name = f".vti, {spacing:g} mm"
        files[name] = folder / f"field_{spacing:g}.vti"
        counts = (np.array((52.0, 80.0, 80.0)) / spacing).astype(int) + 1
        image = pv.ImageData(
            dimensions=counts, spacing=(spacing,) * 3, origin=(-26.0, -40.0, -40.0)
        )
        image.sample(grid, mark_blank=True).save(files[name])
    files["COMSOL, sectionwise"] = comsol.sectionwise(
        folder / "sectionwise.txt",
        points,
        tetrahedra_of(grid).corners.astype(np.int64),
        {"T (degC)": kelvin - ZERO_CELSIUS_K},
    )
    files["COMSOL, spreadsheet"] = comsol.spreadsheet(
        folder / "spreadsheet.csv", points / 1e3, {"T (K)": kelvin}, separator=",", length_unit="m"
    )
    files["OpenFOAM"] = _openfoam(folder / "case", grid)
    return files


def _openfoam(folder: Path, grid: pv.UnstructuredGrid) -> Path:
    """Cells with the mean of their corners; the wall has its own temperature."""
    metres = grid.copy()
    metres.points = np.asarray(grid.points) / 1e3
    cells = np.asarray(grid.point_data_to_cell_data().cell_data["T"], dtype=np.float64)
    wall = float(grid.point_data["T"].max())
    around = Patch("cylinder", "wall", lambda c: np.hypot(c[:, 1], c[:, 2]) < 14.5e-3, wall)
    outside = Patch("outside", "patch", lambda c: np.ones(len(c), dtype=bool), None)
    return write_case(folder, metres, {"1": {"T": cells}}, [around, outside])


def camera() -> Camera:
    """Looks from below, where the air is closed, at 27 mm of the cylinder's middle."""
    return camera_at(tuple(ORIGIN), sensor_mm=(1.2, 1.2), resolution=(80, 80))


def read_all(files: Mapping[str, Path]) -> dict[str, IndexField]:
    """Every file, with no more said than its format needs."""
    part = read_part(folder_of("cylinder") / "part.ply")
    with warnings.catch_warnings():
        # Cut from a larger field, so its coolest air is not the room's.
        warnings.simplefilter("ignore", IriftraceWarning)
        return {name: read_field(path, part=part) for name, path in files.items()}


def traced(folder: Path, fields: Mapping[str, IndexField]) -> dict[str, AovImage]:
    """Pictures of all fields, with shells at the same values of n."""
    part = read_part(folder_of("cylinder") / "part.ply")
    first = next(iter(fields.values()))
    ends = (first.ambient_refractivity, first.hottest_refractivity)
    images = {}
    for number, (name, field) in enumerate(fields.items()):
        stack = contour_shells(field, LAYERS, index_range=ends)
        xml = write_scene(folder / str(number), part, stack, camera(), paraview=False)
        images[name] = pose_image(load_scene(xml))
    return images


def across(vectors: FloatArray, hits: FloatArray) -> FloatArray:
    """Components across the rays from the camera to their hits."""
    along = hits - ORIGIN
    along /= np.linalg.norm(along, axis=1)[:, None]
    return vectors - np.einsum("ij,ij->i", vectors, along)[:, None] * along


def line_integrals(field: IndexField, hits: FloatArray) -> FloatArray:
    """Displacement across the rays from the field alone, to first order, mm.

    The integral of (distance to the hit) times the gradient of n across the straight ray, without
    shells, Snell's law or tracing. As far as the ray runs along the gradient, its length is such
    that n changes by what it does along the ray.
    """
    along = hits - ORIGIN
    along /= np.linalg.norm(along, axis=1)[:, None]
    ends = np.arange(0.0, RANGE_MM + STEP_MM / 2, STEP_MM)
    middles = 0.5 * (ends[1:] + ends[:-1])
    grid = field.grid.copy()
    grid.point_data["gradient"] = field.consistent_gradient
    grid.point_data["n"] = field.refractivity
    index, known = _sampled(grid, "n", hits, along, ends)
    change = (index[:, :-1] - index[:, 1:]) / STEP_MM
    gradient, inside = _sampled(grid, "gradient", hits, along, middles)
    gradient[~inside] = 0.0
    length = np.linalg.norm(gradient, axis=2)
    unit = gradient / np.where(length > 0, length, 1.0)[..., None]
    cosine = np.einsum("ikj,ij->ik", unit, along)
    missing = np.where(known[:, :-1] & known[:, 1:], change - length * cosine, 0.0)
    gradient += (length_gain(cosine) * missing)[..., None] * unit
    return across(STEP_MM * np.einsum("k,ikj->ij", middles, gradient), hits)


def _sampled(
    grid: pv.UnstructuredGrid, name: str, hits: FloatArray, along: FloatArray, back: FloatArray
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """A point array at distances before hits, (rays, distances, ...), and where there is one."""
    places = hits[:, None] - back[:, None] * along[:, None]
    # With VTK's own tolerance, far larger, flat cells claim points next to them.
    found = pv.PolyData(places.reshape(-1, 3)).sample(grid, tolerance=1e-6)
    values = np.asarray(found[name], dtype=np.float64)
    inside = np.asarray(found["vtkValidPointMask"]) != 0
    shape = places.shape[:2]
    return values.reshape(*shape, *values.shape[1:]), inside.reshape(shape)


def compare(folder: Path, spacings: Sequence[float] = SPACINGS_MM) -> list[Line]:
    """Differences of all displacement maps to that of the .vtu, and what they should be."""
    fields = read_all(write_all(folder / "files", spacings))
    images = traced(folder, fields)
    # Shells of the .vti end a cell before the wall, so their steps do not add up there.
    good = np.all(
        [np.isin(i.status, (Status.GOOD, Status.INDEX_MISMATCH)) for i in images.values()], axis=0
    )
    hits = images[".vtu"].vector("straight", good).astype(np.float64)
    found = {
        name: across(image.vector("displacement", good).astype(np.float64), hits)
        for name, image in images.items()
    }
    known = {name: line_integrals(field, hits) for name, field in fields.items()}
    scale = float(np.median(np.linalg.norm(found[".vtu"], axis=1)))
    lines = [
        Line(
            f".vtu: median displacement across the rays, {len(hits):,} of them",
            f"{1e3 * np.median(np.linalg.norm(known['.vtu'], axis=1)):.3f} um",
            f"{1e3 * scale:.3f} um",
        )
    ]
    for name in list(fields)[1:]:
        off, expected = ((m[name] - m[".vtu"]) / scale for m in (found, known))
        lines.append(
            Line(
                f"{name}: difference to the .vtu over its median, rms (median)",
                f"{100 * _rms(expected):.1f} % ({100 * _median(expected):.1f} %)",
                f"{100 * _rms(off):.1f} % ({100 * _median(off):.1f} %)",
                100 * _rms(off - expected),
                LARGEST_REST_PERCENT,
            )
        )
    return lines


def _rms(vectors: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.einsum("ij,ij->i", vectors, vectors))))


def _median(vectors: FloatArray) -> float:
    return float(np.median(np.linalg.norm(vectors, axis=1)))


SECTION = Section(
    "readers",
    "One field, every reader",
    "The bundled cylinder's field, 50 mm of it, written as .vtu, resampled to images, as COMSOL's "
    "text (with elements, and as points alone, between which Delaunay puts other tetrahedra) and "
    "as an OpenFOAM case (means of the cells, and the wall). Each is read with what its format "
    "says and nothing more. What is expected is the difference of the line integrals of the "
    "gradient along the straight rays, computed from each field alone: what its interpolation "
    "makes of the same temperatures. A reader that lost or shifted something would show as a "
    "difference far larger. The error is what is left of the difference, ray by ray, without the "
    "expected one (rms).",
    compare,
)
