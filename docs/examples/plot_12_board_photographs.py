"""
From photographs of a board to a corrected cloud
================================================

The whole way of a printed board, on simulated photographs: the picture without hot air and the one
with it, dots found by OpenCV, the air that moved them, and a cloud that this air corrects. The
truth is known at each step, so image processing can be tried before anything is hot.
"""

import tempfile
from pathlib import Path

import attrs
import matplotlib.pyplot as plt
import numpy as np
from board_shifts import find_dots, pair

import iriftrace

folder = Path(tempfile.mkdtemp())
part = iriftrace.cylinder(12.0, 30.0)
model = iriftrace.synthetic_air(part)
still = iriftrace.synthetic_field(
    model, iriftrace.AirMesh(cell_mm=1.5, sides_mm=18.0, height_mm=36.0)
)


def leaning(lean):
    """Air whose plume leans by so many mm per mm towards +y, as in a draught."""
    grid = still.grid.copy()
    points = np.array(grid.points)
    points[:, 1] -= lean * np.maximum(points[:, 2] - part.bounds[1, 2], 0.0)
    grid.clear_data()
    grid.point_data["T"] = model.at(points)[0]
    grid.save(folder / f"lean_{lean:g}.vtu")
    return iriftrace.read_field(folder / f"lean_{lean:g}.vtu")


# %%
# The air of this hall leans by 0.3, which is none of the simulated states. A board of dots stands
# behind the part, and the camera looks past it along the cylinder's axis.

printed = iriftrace.Board((70.0, 70.0), 2.0)
upright = np.array(((0, 0, 1.0, -60.0), (1.0, 0, 0, 0), (0, 1.0, 0, 12.0), (0, 0, 0, 1.0)))
camera = iriftrace.Camera(
    focal_length_mm=20.0,
    sensor_mm=(6.0, 5.0),
    resolution=(720, 600),
    matrix=iriftrace.look_at((130.0, 0.0, 10.0), (0.0, 0.0, 10.0)),
)
truth = iriftrace.HotAir(leaning(0.3))
scene = iriftrace.Scene(
    printed.part.transformed(upright), truth, camera, blockers=[part], engine="cells"
)
taken = iriftrace.photograph(
    scene,
    air="both",
    part=iriftrace.Appearance(0.2, printed=iriftrace.Dots.of_board(printed), to_world=upright),
    blockers=iriftrace.Appearance(temperature="1100 degC"),
    ambient=1.0,
    samples=2,
)
taken.save(folder / "photograph" / "image.tiff")
cold, hot = taken.pictures["cold"], taken.pictures["hot"]
places, shifts = pair(find_dots(cold), find_dots(hot))

# %%
# The dots' shifts against the truth in the same folder.

column, row = (places + shifts).round().astype(int).T
true = np.stack([taken.truth.channels[f"shift.px.{axis}"][row, column] for axis in "XY"], axis=1)
off = np.linalg.norm(shifts - true, axis=1)
print(f"{len(shifts)} dots, shifts up to {np.abs(true).max():.2f} px")
print(f"they differ from the truth by {np.median(off):.3f} px (median)")

figure, axes = plt.subplots(figsize=(7, 5.5), layout="constrained")
axes.imshow(hot, cmap="gray")
axes.quiver(*places.T, *shifts.T, angles="xy", scale_units="xy", scale=0.01, color="tab:orange")
axes.set_title("hot picture, shifts of the dots 100 times as long")
axes.set_axis_off()

# %%
# Which mixture of four simulated states moves the dots alike?

table = np.hstack((places, shifts))
np.savetxt(folder / "shifts.csv", table, delimiter=",", header="u,v,du,dv", comments="")
measured = iriftrace.read_measured_shift(folder / "shifts.csv")
leans = (0.0, 0.2, 0.4, 0.6)
fields = [leaning(lean) for lean in leans]
fit = iriftrace.fit_members(attrs.evolve(scene, air=iriftrace.HotAir(fields)), measured)
print(f"weights {np.round(fit.weights.weights, 2)}: leaning by {fit.weights.weights @ leans:.2f}")

# %%
# Two cameras to the lee look through the plume; the fitted air corrects what they measure.

devices = [
    iriftrace.Camera(
        focal_length_mm=20.0,
        sensor_mm=(6.0, 5.0),
        resolution=(90, 75),
        matrix=iriftrace.look_at(place, (0.0, 0.0, 2.0)),
    )
    for place in ((-25.0, 55.0, 70.0), (25.0, 55.0, 70.0))
]
hall = iriftrace.Scene(part, truth, *devices, second_id="camera_2", engine="cells")
scan = iriftrace.measure(hall)


def rms_um(points):
    """Root mean square of the errors along the normal, µm."""
    return 1e3 * np.sqrt(np.mean(np.sum((points - scan.true) * scan.normal, axis=1) ** 2))


airs = {
    "still air": iriftrace.HotAir(fields[0]),
    "the board's air": iriftrace.HotAir(fields, weights=fit.weights),
}
left = {"nothing": rms_um(scan.points)}
for name, air in airs.items():
    left[name] = rms_um(iriftrace.correct(scan.points, attrs.evolve(hall, air=air)).points)
for name, error in left.items():
    print(f"error along the normal, corrected with {name}: {error:.2f} µm")
assert np.median(off) < 0.02
assert abs(fit.weights.weights @ leans - 0.3) < 0.05
assert left["the board's air"] < 0.3 * left["still air"] < 0.3 * left["nothing"]
