"""
Derivatives: a diameter, a pose, a plume
========================================

Hits are differentiable by the air and by the camera with Dr.Jit, as in Mitsuba's own tutorials.
Three uses: which air a measured diameter depends on, a pose that is refined by its gradient, and
the lean of a plume that is found from the dots of a board.
"""

import drjit as dr
import matplotlib.pyplot as plt
import mitsuba as mi
import numpy as np
from attrs import evolve

import iriftrace
from iriftrace.core.files import FileOrigin
from iriftrace.scenes import folder_of

air = iriftrace.read_field(folder_of("cylinder") / "field.vtu")
devices = iriftrace.load_scene(folder_of("fringe_cylinder") / "scene.xml", {"scale": 0.1})
part = devices.part
scene = iriftrace.Scene(
    part,
    iriftrace.HotAir(air),
    devices.camera,
    second=devices.second,
    second_id="projector",
    engine="cells",
)

# %%
# Which air moves this diameter?
# ------------------------------
#
# One reverse pass for each device gives the derivative by the temperature at all points, through
# both lines of sight, the triangulation and the fit of the cylinder.

found = iriftrace.sensitivity(scene, "cylinder:lateral", system="fringe")
print(f"{found.sentence}; hot air makes it {1e3 * (found.measured_mm - found.cold_mm):.2f} µm")

distance, fraction = found.by_distance
figure, axes = plt.subplots(figsize=(6, 3.5), layout="constrained")
axes.plot(distance, 100 * fraction)
axes.axhline(80, color="grey", linestyle=":")
axes.set(xlabel="distance from the part (mm)", xlim=(0, 30))
axes.set_ylabel("of what moves the diameter (%)")

# %%
# A camera's pose through hot air
# -------------------------------
#
# Marks on the part are seen at known pixels. Their lines of sight are bent, so that straight
# lines place the camera wrongly. Gauss-Newton steps with the derivatives of the bent hits by shift
# and rotation of the camera find it again.

truth = iriftrace.Scene(part, iriftrace.HotAir(air), devices.camera, engine="cells")
width, height = devices.camera.resolution
pixels = np.random.default_rng(1).uniform((0, 0), (width - 1, height - 1), (600, 2))
origins, directions = devices.camera.rays(pixels)
seen = iriftrace.hits(truth, (mi.Point3d(origins.T), mi.Vector3d(directions.T)))
facing = (seen.status.numpy() == 0) & (np.cos(seen.incidence.numpy()) > 0.5)
marks = seen.refracted.numpy().T[facing]
rays = seen.ray.numpy()[facing]
origins, directions = origins[rays], directions[rays]


def hits_of(parameters, bent):
    """Hits of the marks' lines of sight from a camera moved by mm and turned by rad."""
    shift, turn = mi.Vector3d(*parameters[:3]), mi.Vector3d(*parameters[3:])
    start, along = mi.Point3d(origins.T), mi.Vector3d(directions.T)
    along = dr.normalize(along + dr.cross(turn, along))
    hits = iriftrace.hits(truth, (start + shift, along))
    return hits.refracted if bent else hits.straight, hits.ray


def found_pose(bent):
    """Shift (mm) and turn (rad) of the camera for which the lines of sight end on the marks."""
    pose = np.array([0.4, -0.3, 0.5, 1e-3, -2e-3, 1e-3])  # a start that is off
    for _ in range(4):
        columns = []
        for number in range(6):
            parameters = [dr.opaque(mi.Float64, value) for value in pose]
            dr.enable_grad(parameters[number])
            ends, ray = hits_of(parameters, bent)
            dr.forward(parameters[number])
            columns.append(dr.grad(ends).numpy().ravel())
        off = (ends.numpy() - marks[ray.numpy()].T).ravel()
        pose = pose - np.linalg.lstsq(np.transpose(columns), off)[0]
    return pose


straight, bent = found_pose(bent=False), found_pose(bent=True)
print(
    f"pose by straight lines off by {1e3 * np.linalg.norm(straight[:3]):.1f} µm, "
    f"by bent ones by {1e3 * np.linalg.norm(bent[:3]):.4f} µm"
)

# %%
# The lean of a plume from a board
# --------------------------------
#
# A draught shears the air above the part. A board of dots at its end is photographed cold and hot;
# few numbers of the air are fitted to the shifts of its dots. (The same program made the shifts; a
# real plume does more than lean.)

LEAN = 0.1  # mm per mm of height
sheared = air.grid.copy()
above = np.maximum(sheared.points[:, 2] - part.vertices[:, 2].max(), 0)
sheared.points[:, 1] += LEAN * above
leaning = evolve(air, grid=sheared)

board = iriftrace.Board((200.0, 120.0), 4.0)
behind = np.array([[0.0, 0, -1, 160], [-1, 0, 0, 0], [0, 1, 0, 40], [0, 0, 0, 1]])
whole = iriftrace.load_scene(folder_of("fringe_cylinder") / "scene.xml", {"scale": 1.0}).camera
camera = evolve(whole, matrix=iriftrace.look_at((-160, 0, 40), (0, 0, 40)))


def view_of_board(field):
    """The board, seen past the hot part."""
    return iriftrace.Scene(
        board.part.transformed(behind),
        iriftrace.HotAir(field),
        camera,
        blockers=[part],
        engine="cells",
    )


def shifts_of(scene, noise_px):
    """Shifts of the dots that are seen, px, as measured between a cold and a hot picture."""
    dots = board.centres @ behind[:3, :3].T + behind[:3, 3]
    cold = camera.project(dots)
    hot = cold.copy()
    for _ in range(4):  # the pixel whose bent ray ends where the straight one does
        hot += cold - camera.project(iriftrace.trace_rays(scene, *camera.rays(hot)).refracted)
        seen = np.isfinite(hot).all(axis=1)  # not hidden by the part
        cold, hot = cold[seen], hot[seen]
    noise = np.random.default_rng(2).normal(0, noise_px, hot.shape)
    return iriftrace.MeasuredShift(cold, hot - cold + noise, None, FileOrigin("simulated", ""))


measured = shifts_of(view_of_board(leaning), 0.02)
fit = iriftrace.fit_free(view_of_board(air), measured, ["lean"], noise_px=0.02)
for name, value in fit.values.items():
    print(f"{name}: {value:.4f} mm per mm, u = {fit.u[name]:.4f}")
print(f"residual {fit.before:.3f} px before, {fit.residual:.3f} px after")

figure, axes = plt.subplots(figsize=(6, 5), layout="constrained")
arrows = axes.quiver(
    *measured.places.T, *measured.shifts.T, angles="xy", scale_units="xy", scale=0.05
)
axes.quiverkey(arrows, 0.9, 1.03, 5, "5 px")
axes.set(xlabel="u (px)", ylabel="v (px)", aspect="equal")
axes.invert_yaxis()

assert 4 < found.within(0.8) < 10
assert np.linalg.norm(bent[:3]) < 1e-5 < 1e-3 < np.linalg.norm(straight[:3])
assert abs(fit.values["lean y"] - LEAN) < 3 * fit.u["lean y"] < 0.01
