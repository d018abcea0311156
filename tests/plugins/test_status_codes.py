"""Each status code from a small scene made for it, and their order."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

import iriftrace
from iriftrace.core.errors import IriftraceWarning
from iriftrace.image.aov_image import CHANNELS, Status
from iriftrace.part.part import part_of_mesh
from iriftrace.scenes.analytic import concentric_cylinders, slab
from iriftrace.tracing.pose_image import pose_image
from iriftrace.tracing.rays import trace_rays
from validation.inputs.cameras import camera_at
from validation.inputs.scene_rays import loaded
from validation.inputs.small_scenes import (
    AMBIENT,
    HOT,
    ball_in_shells,
    camera,
    channels,
    film,
    nested_spheres,
    part,
    ply,
    scene,
    shell,
    sphere,
    vector,
)

pytestmark = pytest.mark.usefixtures("variant")


def status(pixels: dict[str, np.ndarray]) -> np.ndarray:
    return pixels["status.code"].astype(int)


def impact_parameter() -> np.ndarray:
    """(40, 48) array, mm: distance of each pixel's straight ray from the origin."""
    origins, directions = camera_at().rays()
    return np.linalg.norm(np.cross(origins, directions), axis=1).reshape(40, 48)


def box(size: tuple[float, ...], centre: tuple[float, ...]) -> trimesh.Trimesh:
    return trimesh.creation.box(size, transform=trimesh.transformations.translation_matrix(centre))


def test_missed_and_good(tmp_path: Path) -> None:
    """Rays that pass the ball by more than its radius miss; those well inside hit and are good.

    An icosphere of 1280 faces lies up to 0.6 % inside its sphere.
    """
    codes = status(channels(scene(ball_in_shells(tmp_path))))
    near = impact_parameter()
    assert (codes[near > 10] == Status.MISSED).all()
    assert (codes[near < 9.9] == Status.GOOD).all()


def test_out_of_focus(tmp_path: Path) -> None:
    """By the length of the straight ray, at both ends of the interval; the hits stay."""
    near, far = 91.0, 95.0
    sensor = camera(focus_near=near, focus_far=far)
    pixels = channels(scene(ball_in_shells(tmp_path), sensor))
    codes = status(pixels)
    hit = pixels["part.face"] > 0
    length = np.linalg.norm(vector(pixels, "straight") - (0, -100, 0), axis=-1)
    sharp = (length >= near) & (length <= far)
    np.testing.assert_array_equal(codes[hit & sharp], Status.GOOD)
    np.testing.assert_array_equal(codes[hit & ~sharp], Status.OUT_OF_FOCUS)
    assert (hit & (length < near)).any()
    assert (hit & (length > far)).any()
    assert (hit & sharp).any()


def test_blocked_by_another_object(tmp_path: Path) -> None:
    """Where a board is in the way of the straight ray; it may or may not have an id."""
    board = ply(tmp_path / "board.ply", box((30, 1, 8), (0, -50, 0)), bsdf={"type": "diffuse"})
    pixels = channels(scene({**ball_in_shells(tmp_path), "fixture": board}))
    codes = status(pixels)
    # The board is 8 mm high, its near face 49.5 mm away: +-4 mm there are +-8.08 mm at the ball.
    _, directions = camera_at().rays()
    at_board = (directions[:, (0, 2)] / directions[:, 1:2] * 49.5).reshape(40, 48, 2)
    behind = (np.abs(at_board) < (15, 4)).all(axis=-1)
    np.testing.assert_array_equal(codes[behind], Status.BLOCKED)
    # A blocked straight ray has no hit on the part.
    for name in CHANNELS:
        if name != "status.code":
            np.testing.assert_array_equal(pixels[name][behind], 0)
    free = ~behind & (impact_parameter() < 9.9)
    assert free.any()
    np.testing.assert_array_equal(codes[free], Status.GOOD)


def test_blocked_for_the_refracted_ray_alone(tmp_path: Path) -> None:
    """A glass plate at 45 degrees shifts rays sideways, onto a rod that the straight rays miss.

    Shift of a plate of thickness t: t sin(i) (1 - cos(i) / sqrt(n^2 - sin(i)^2)), here 3.29 mm.
    """
    plate = box((60, 10, 60), (0, 0, 0))
    plate.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 4, (0, 0, 1)))
    plate.apply_translation((0, -45, 0))
    rod = box((2.4, 0.6, 60), (0.0, -12, 0))
    pixels = channels(
        scene(
            {
                "part": part(tmp_path, box((50, 2, 40), (0, 0, 0))),
                "plate": shell(tmp_path, "plate", plate, 1.0, 1.5),
                "rod": ply(tmp_path / "rod.ply", rod, bsdf={"type": "diffuse"}),
            }
        )
    )
    codes = status(pixels)
    on_part = pixels["part.face"] > 0
    columns = [
        np.flatnonzero((codes == 7).any(axis=0) & seen.any(axis=0))
        for seen in ((codes == 7) & ~on_part, (codes == 7) & on_part)
    ]
    direct, bent = (c.mean() for c in columns)
    # The plate turned about z by 45 degrees shifts towards one side by 3.29 mm; seen 88 mm away.
    assert abs(bent - direct) == pytest.approx(3.29 / 88 * 10 / 6 * 48, abs=1.0)
    assert direct == pytest.approx(23.5, abs=0.6)
    between = slice(int(min(direct, bent)) + 2, int(max(direct, bent)) - 1)
    assert (codes[10:30, between] == Status.GOOD).all()


def test_gave_up_at_the_crossing_limit(tmp_path: Path) -> None:
    """Three crossings lead to the ball: a limit of three stops a ray at the third."""
    for limit, expected in ((1, Status.GAVE_UP), (3, Status.GAVE_UP), (4, Status.GOOD)):
        pixels = channels(scene(ball_in_shells(tmp_path), max_crossings=limit))
        hit = pixels["part.face"] > 0
        np.testing.assert_array_equal(status(pixels)[hit], expected)
        np.testing.assert_array_equal(pixels["path.crossings"][hit], min(limit, 3))
        if expected == Status.GAVE_UP:
            np.testing.assert_array_equal(pixels["displacement.norm"], 0)
            np.testing.assert_array_equal(pixels["refracted.Y"], 0)


@pytest.mark.parametrize("trace_all", [False, True])
def test_only_refracted(tmp_path: Path, trace_all: bool) -> None:
    """A ball of index n makes the part look n times as large (Bouguer): rays that pass it by 10 to
    12 mm hit it. They are known only when all rays are traced on."""
    glass = nested_spheres(tmp_path, (20.0,), (1.0, 1.2), subdivisions=4)
    pixels = channels(scene({"part": part(tmp_path, sphere(10.0)), **glass}, trace_all=trace_all))
    codes, near = status(pixels), impact_parameter()
    ring = (near > 10.05) & (near < 11.9)
    assert ring.sum() > 50
    np.testing.assert_array_equal(
        codes[ring], Status.ONLY_REFRACTED if trace_all else Status.MISSED
    )
    # Some that graze the glass run along its facets, turned by more than its index allows.
    grazing = np.abs(near - 20.0) < 1.0
    np.testing.assert_array_equal(codes[(near > 12.1) & ~grazing], Status.MISSED)
    assert set(codes[grazing]) <= {Status.MISSED, Status.INDEX_MISMATCH}
    np.testing.assert_array_equal(codes[near < 9.9], Status.GOOD)
    for name in ("straight.Y", "displacement.norm", "incidence.angle", "part.face"):
        np.testing.assert_array_equal(pixels[name][ring], 0)
    if trace_all:
        # The refracted hit exists, on the ball, with its path and its place in the picture.
        radius = np.linalg.norm(vector(pixels, "refracted")[ring], axis=1)
        np.testing.assert_allclose(radius, 10, rtol=0.01)
        assert (pixels["path.length"][ring] > 80).all()
        assert (np.hypot(pixels["shift.px.X"], pixels["shift.px.Y"])[ring] > 0.5).all()
    else:
        np.testing.assert_array_equal(pixels["path.crossings"][ring], 0)


@pytest.mark.parametrize("trace_all", [False, True])
def test_a_wall_behind_the_part_is_in_no_rays_way(tmp_path: Path, trace_all: bool) -> None:
    """Rays that end there miss the part, or only the refracted one hits it, as without the wall."""
    glass = nested_spheres(tmp_path, (20.0,), (1.0, 1.2), subdivisions=4)
    wall = ply(tmp_path / "wall.ply", box((300, 1, 300), (0, 60, 0)), bsdf={"type": "diffuse"})
    content = {"part": part(tmp_path, sphere(10.0)), **glass, "wall": wall}
    codes = pose_image(iriftrace.from_mitsuba(scene(content, trace_all=trace_all))).status
    near = impact_parameter()
    ring = (near > 10.05) & (near < 11.9)
    expected = Status.ONLY_REFRACTED if trace_all else Status.MISSED
    np.testing.assert_array_equal(codes[ring], expected)
    np.testing.assert_array_equal(codes[near > 12.1], Status.MISSED)
    np.testing.assert_array_equal(codes[near < 9.9], Status.GOOD)


def test_refracted_missed(tmp_path: Path) -> None:
    """In a ball of smaller index the part looks smaller: rays between 8.33 and 10 mm pass it."""
    hollow = nested_spheres(tmp_path, (20.0,), (1.2, 1.0), subdivisions=4)
    pixels = channels(scene({"part": part(tmp_path, sphere(10.0)), **hollow}))
    codes, near = status(pixels), impact_parameter()
    ring = (near > 8.45) & (near < 9.9)
    assert ring.sum() > 20
    np.testing.assert_array_equal(codes[ring], Status.REFRACTED_MISSED)
    np.testing.assert_array_equal(codes[near < 8.2], Status.GOOD)
    assert (pixels["straight.Y"][ring] < 0).all()
    for name in ("refracted.Y", "displacement.norm", "shift.px.X", "path.length"):
        np.testing.assert_array_equal(pixels[name][ring], 0)


def punched(mesh: trimesh.Trimesh, direction: tuple[float, ...], degrees: float) -> trimesh.Trimesh:
    """The mesh without the triangles around a direction."""
    centres = mesh.triangles_center / np.linalg.norm(mesh.triangles_center, axis=1, keepdims=True)
    towards = np.asarray(direction) / np.linalg.norm(direction)
    return trimesh.Trimesh(
        mesh.vertices, mesh.faces[centres @ towards < np.cos(np.radians(degrees))], process=False
    )


def air_with_a_hole(folder: Path, holed: str) -> dict[str, np.ndarray]:
    """Picture of a ball in two shells, one of which has a hole of 4 degrees.

    It lies where the rays run that pass the centre by 9 mm: they enter there, obliquely, and hit
    the ball far from where the hole is overhead.
    """
    middle = (AMBIENT + HOT) / 2
    air = {}
    for name, radius, ext, inner in (
        ("outer", 20.0, AMBIENT, middle),
        ("inner", 14.0, middle, HOT),
    ):
        mesh = sphere(radius, 4)
        if name == holed:
            mesh = punched(mesh, (9.0, -np.sqrt(radius**2 - 81), 0.0), 4.0)
        air[name] = shell(folder, name, mesh, ext, inner)
    sensor = camera(film=film(96, 80))
    loaded = scene({"part": part(folder, sphere(10.0, 4)), **air}, sensor)
    tensor, report = loaded.integrator().image(loaded, loaded.sensors()[0])
    return {
        **dict(zip(CHANNELS, np.array(tensor), strict=True)),
        "open_boundary": np.array(report["counts"]["open_boundary"]),
    }


def test_index_mismatch_behind_a_hole_in_an_inner_shell(tmp_path: Path) -> None:
    """Rays through the hole miss one step: they start in ambient air and end in a layer that is not
    at the part there. Hits and displacement stay, for those who include code 5."""
    pixels = air_with_a_hole(tmp_path, "inner")
    hit = pixels["part.face"] > 0
    through = hit & (pixels["path.crossings"] == 1)
    assert through.sum() >= 3
    np.testing.assert_array_equal(status(pixels)[through], Status.INDEX_MISMATCH)
    np.testing.assert_array_equal(status(pixels)[hit & ~through], Status.GOOD)
    assert (pixels["displacement.norm"][through] > 0).all()
    assert pixels["open_boundary"] == 0


def test_hole_in_the_outermost_shell_is_an_open_boundary(tmp_path: Path) -> None:
    """The same hole in the outermost shell cannot be told from the edge of the data."""
    pixels = air_with_a_hole(tmp_path, "outer")
    hit = pixels["part.face"] > 0
    np.testing.assert_array_equal(status(pixels)[hit], Status.GOOD)
    through = hit & (pixels["path.crossings"] == 1)
    assert through.sum() >= 3
    assert pixels["open_boundary"] == through.sum()


def test_a_shell_may_end_on_the_part(tmp_path: Path) -> None:
    """Where the wall is cooler than a shell's temperature, the shell goes into the part."""
    cut = sphere(9.0)
    cut.apply_translation((0, 0, 5.0))
    pixels = channels(
        scene(
            {
                "part": part(tmp_path, sphere(10.0)),
                **nested_spheres(tmp_path, (16.0,), (AMBIENT, (AMBIENT + HOT) / 2)),
                "shell_2": shell(tmp_path, "shell_2", cut, (AMBIENT + HOT) / 2, HOT),
            }
        )
    )
    hit = pixels["part.face"] > 0
    crossings = pixels["path.crossings"][hit]
    assert set(crossings) == {1, 2}
    np.testing.assert_array_equal(status(pixels)[hit], Status.GOOD)


def test_open_boundary_counts_rays_that_enter_through_the_open_end(tmp_path: Path) -> None:
    """Tubes of hot air are open at both ends. Rays that cross the end disc inside the outermost
    tube and then hit the lateral surface start in hot air, also those that cross no tube at all;
    their status stays 0. What hits the head, outside the tubes, does not."""
    body, stack = concentric_cylinders(3, sections=120, length_mm=60.0, rule="midpoint")
    mesh = trimesh.Trimesh(body.vertices, body.faces, process=False)
    tubes = {
        f"shell_{s.layer}": shell(
            tmp_path,
            f"shell_{s.layer}",
            trimesh.Trimesh(s.vertices, s.faces, process=False),
            1 + s.ext,
            1 + s.int_,
            s.normals,
        )
        for s in stack.shells
    }
    place = (55.0, -100.0, 30.0)
    loaded = scene({"part": part(tmp_path, mesh), **tubes}, camera(place))
    tensor, report = loaded.integrator().image(loaded, loaded.sensors()[0])
    pixels = dict(zip(CHANNELS, np.array(tensor), strict=True))
    good = status(pixels) == Status.GOOD
    assert Status.INDEX_MISMATCH not in status(pixels)
    origins, directions = (v.reshape(40, 48, 3) for v in camera_at(place).rays())
    share = (30.0 - origins[..., 0]) / directions[..., 0]
    at_end = origins + share[..., None] * directions
    radius = np.hypot(at_end[..., 1], at_end[..., 2])
    lateral = vector(pixels, "straight")[..., 0] < 29.9
    outermost = np.linalg.norm(stack.shells[0].vertices[:, 1:], axis=1).min()
    expected = good & lateral & (radius < outermost)
    assert expected.sum() > 50
    assert (good & lateral & ~expected).sum() > 20
    # The tubes' facets and the bending decide for the rays at their rims.
    assert report["counts"]["open_boundary"] == pytest.approx(expected.sum(), abs=3)


def test_order_of_the_codes(tmp_path: Path) -> None:
    """2 before 7 and 6, 6 before 3 to 5: the first that applies of 1, 2, 7, 6, 3, 4, 5, 0."""
    far = camera(focus_far=50.0)
    pixels = channels(scene(ball_in_shells(tmp_path), far, max_crossings=1))
    hit = pixels["part.face"] > 0
    np.testing.assert_array_equal(status(pixels)[hit], Status.OUT_OF_FOCUS)
    hollow = nested_spheres(tmp_path, (20.0,), (1.2, 1.0), subdivisions=4)
    only = scene({"part": part(tmp_path, sphere(10.0)), **hollow}, max_crossings=1)
    pixels = channels(only)
    np.testing.assert_array_equal(status(pixels)[pixels["part.face"] > 0], Status.GAVE_UP)


def test_status_keys_are_those_of_the_metrics() -> None:
    assert {code.key: int(code) for code in Status} == {
        "good": 0,
        "missed": 1,
        "out_of_focus": 2,
        "refracted_missed": 3,
        "only_refracted": 4,
        "index_mismatch": 5,
        "gave_up": 6,
        "blocked": 7,
    }


def test_back_of_an_open_part_is_not_taken_for_a_slip(tmp_path: Path) -> None:
    """Two sheets, the lower one seen from its back: the hit stays on it.

    A ray that slipped through the part's front is brought back; here nothing has slipped, and going
    back along the ray would lead past the camera to the upper sheet.
    """
    corners = np.array([[-40.0, -40.0], [40.0, -40.0], [40.0, 40.0], [-40.0, 40.0]])
    lower, upper = (np.column_stack((corners, np.full(4, z))) for z in (0.0, 300.0))
    with pytest.warns(IriftraceWarning, match="not closed"):
        sheets = part_of_mesh(
            np.concatenate((lower, upper)),
            [[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7]],
            name="two sheets",
        )
    _, shells = slab(13, size_mm=60.0)
    with pytest.warns(IriftraceWarning, match="not closed"):
        scene = loaded(tmp_path, sheets, shells)
    hits = trace_rays(scene, [(0.0, 0.0, 120.0)], [(0.05, 0.0, -1.0)])
    assert hits.refracted_face[0] == hits.face[0]
    assert hits.refracted[0] == pytest.approx(hits.straight[0], abs=0.1)
    assert hits.path_length[0] > 0
