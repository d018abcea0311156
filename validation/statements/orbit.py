"""The short sweep around a component, and what it says of faces and poses."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path

import numpy as np
import xarray as xr
from attrs import frozen
from numpy.typing import NDArray

from iriftrace.camera.orbit import Orbit, orbit_poses, semi_axes
from iriftrace.part.part import Part
from iriftrace.scenes import folder_of
from iriftrace.sweep.sweep import run_sweep
from iriftrace.tracing.load import load_scene

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

AZIMUTH_DEG = 22.5 * np.arange(16)
ELEVATION_DEG = np.array((-90.0, -60.0, -30.0, 0.0, 30.0, 60.0, 90.0))
SCALE = "0.15"

FROM_ABOVE_DEG = 45.0
"""Poses higher than this look down through the plume."""


@frozen(eq=False, slots=False)
class Swept:
    """A component's part and the sweep around it.

    Attributes
    ----------
    part : Part
    dataset : xarray.Dataset
    """

    part: Part
    dataset: xr.Dataset

    @cached_property
    def towards(self) -> FloatArray:
        """(n, 3) array: unit vectors from what is looked at to the cameras."""
        return -np.asarray(self.dataset["matrix"].values[:, :3, 2], dtype=np.float64)

    @cached_property
    def elevation_deg(self) -> FloatArray:
        """(n,) array: angle of the lines of sight above the horizontal."""
        return np.degrees(np.arcsin(np.clip(self.towards[:, 2], -1.0, 1.0)))

    @property
    def beside_plume(self) -> BoolArray:
        """(n,) poses that do not look down through the plume."""
        return self.elevation_deg < FROM_ABOVE_DEG

    def angle_to(self, direction: tuple[float, float, float] | FloatArray) -> FloatArray:
        """(n,) array, degree: between lines of sight and a direction (one direction only)."""
        unit = np.asarray(direction, dtype=np.float64) / np.linalg.norm(direction)
        return np.degrees(np.arccos(np.clip(self.towards @ unit, -1.0, 1.0)))

    def median_um(self, region: str = "part") -> FloatArray:
        """(n,) array: median displacement that each pose sees."""
        return 1e3 * np.asarray(self.dataset["displacement_median"].sel(region=region).values)

    def region(self, *names: str) -> BoolArray:
        """(m,) faces of some of the part's regions."""
        numbers = [self.part.region_names.index(name) for name in names]
        return np.isin(self.part.region_of_face, numbers)

    def on_faces_um(
        self, faces: BoolArray, poses: BoolArray, incidence_deg: tuple[float, float] = (0.0, 90.0)
    ) -> float:
        """Median, over the rays of some poses, of the displacement on some faces.

        Parameters
        ----------
        faces, poses
            (m,) and (n,) masks.
        incidence_deg
            Only where a face is seen at an angle of incidence within these bounds.
        """
        sighted = self.dataset
        counts = sighted["sightings"].values
        pose = np.repeat(np.arange(len(counts)), counts)
        angle = sighted["sighting_incidence"].values
        low, high = incidence_deg
        used = faces[sighted["sighting_face"].values] & poses[pose] & (angle >= low)
        used &= angle <= high
        values = 1e3 * sighted["sighting_displacement"].values[used]
        rays = sighted["sighting_rays"].values[used]
        order = np.argsort(values)
        middle = np.searchsorted(np.cumsum(rays[order]), 0.5 * rays.sum())
        return float(values[order][middle])

    def face_medians_um(self, poses: BoolArray) -> FloatArray:
        """(m,) array: median over some poses of the displacement on each face; NaN if unseen."""
        sighted = self.dataset
        counts = sighted["sightings"].values
        used = poses[np.repeat(np.arange(len(counts)), counts)]
        used &= sighted["sighting_rays"].values > 0
        face = sighted["sighting_face"].values[used]
        values = 1e3 * sighted["sighting_displacement"].values[used].astype(np.float64)
        order = np.lexsort((values, face))
        numbers, first, length = np.unique(face[order], return_index=True, return_counts=True)
        medians = np.full(len(self.part.faces), np.nan)
        low, high = first + (length - 1) // 2, first + length // 2
        medians[numbers] = 0.5 * (values[order][low] + values[order][high])
        return medians


def sweep_around(
    scene: str, folder: Path, *, stand_off_mm: float, target: FloatArray | None = None
) -> Swept:
    """Look at a bundled scene's part from 82 directions on an ellipsoid around it.

    Parameters
    ----------
    scene
        Name of the bundled scene.
    folder
        Folder of the sweep; an existing sweep is not computed again.
    stand_off_mm
        Between the part's extents and the cameras.
    target
        What is looked at, mm; by default the part's middle.
    """
    loaded = load_scene(folder_of(scene) / "scene.xml", {"scale": SCALE})
    aim = loaded.part.centre if target is None else target
    orbit = Orbit(aim, semi_axes(loaded.part, stand_off_mm), angles="geocentric")
    poses = orbit_poses(orbit, AZIMUTH_DEG, ELEVATION_DEG, aim)
    dataset = run_sweep(loaded, poses, folder / f"{scene}.nc", target=aim)
    return Swept(loaded.part, dataset)
