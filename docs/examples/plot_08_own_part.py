"""
A part of one's own, without a flow solver
==========================================

A flange from trimesh, a boundary layer and a plume around it from formulas, and a scene of both.
The field is no simulation and every result says so; it is meant for a quick look.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import trimesh

import iriftrace

folder = Path(tempfile.mkdtemp())
trimesh.creation.annulus(r_min=25.0, r_max=60.0, height=18.0, sections=96).export(
    folder / "flange.stl"
)
part = iriftrace.read_part(folder / "flange.stl")
field = iriftrace.synthetic_field(
    iriftrace.synthetic_air(part),
    iriftrace.AirMesh(cell_mm=3.0, sides_mm=30.0, height_mm=80.0),
)
camera = iriftrace.Camera(
    focal_length_mm=10.0,
    sensor_mm=(6.7, 5.6),
    resolution=(153, 128),
    matrix=iriftrace.look_at(origin=(140.0, -140.0, 140.0), target=(0.0, 0.0, 0.0)),
)
rendering = iriftrace.render_scene(iriftrace.Scene(part, iriftrace.HotAir(field), camera))
moved = iriftrace.displacement_map(rendering.image)

figure, axes = plt.subplots(figsize=(6, 4.5), layout="constrained")
drawn = axes.imshow(np.where(moved.good, 1e3 * moved.norm, np.nan), norm="log")
figure.colorbar(drawn, label="displacement (µm)")
axes.set_axis_off()

median = 1e3 * np.median(moved.norm[moved.good])
print(f"{moved.good.sum()} pixels see the flange; median displacement {median:.2f} µm")
assert 0.1 < median < 20.0
