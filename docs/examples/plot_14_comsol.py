"""
Bring a COMSOL export
=====================

COMSOL exports a solution as text: for each point its coordinates and the temperature. Here such a
file is written from a formula, so that what is read can be compared with it; yours is read alike.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import iriftrace

folder = Path(tempfile.mkdtemp())
part = iriftrace.cylinder(12.0, 30.0)
air = iriftrace.synthetic_air(part)
mesh = iriftrace.AirMesh(cell_mm=1.5, sides_mm=15.0, height_mm=30.0)
known = iriftrace.synthetic_field(air, mesh)
points = np.asarray(known.grid.points, dtype=float)

export = folder / "temperature.txt"
head = f"Dimension: 3\nNodes: {len(points)}\nExpressions: 1\nLength unit: m\nx y z T (degC)"
values = np.column_stack((points / 1000, air.at(points)[0] - 273.15))
np.savetxt(export, values, fmt="%.9g", header=head, comments="% ")

# %%
# The file states its units, so nothing has to be given but the part: a table of points has no
# elements, and the part is cut out of those that are put between the points.

field = iriftrace.read_field(export, part=part)
print(field)
for finding in iriftrace.check_field(field, part).findings:
    print(f"{finding.name}: {finding.value} ({finding.verdict})")

# %%
# What a camera sees through it, against the same air with the elements that it was computed on.

camera = iriftrace.Camera(
    focal_length_mm=20.0,
    sensor_mm=(6.0, 5.0),
    resolution=(150, 125),
    matrix=iriftrace.look_at((60.0, -60.0, 60.0), (0.0, 0.0, 0.0)),
)
maps = [
    iriftrace.displacement_map(
        iriftrace.render_scene(
            iriftrace.Scene(part, iriftrace.HotAir(one), camera, engine="cells")
        ).image
    )
    for one in (field, known)
]
read, own = maps
both = read.good & own.good
ratio = np.median(read.norm[both] / own.norm[both])

figure, axes = plt.subplots(figsize=(6, 4.5), layout="constrained")
drawn = axes.imshow(np.where(read.good, 1e3 * read.norm, np.nan), norm="log")
figure.colorbar(drawn, label="displacement (µm)")
axes.set_axis_off()

print(f"displacement by the table / by the elements: {ratio:.3f} (median)")
assert abs(ratio - 1) < 0.05
