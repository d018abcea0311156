"""Air outside of a fit's members: the scene is written, and U covers or the verdict says so.

A cylinder of 12 mm in air of a formula; the plume leans in a draught, and devices look past it.
"""

import json
from pathlib import Path

import attrs
import numpy as np
import pytest
import pyvista as pv
import trimesh

import iriftrace
from iriftrace.cli import main
from iriftrace.core.errors import IriftraceWarning
from iriftrace.core.member_weights import MemberWeights
from iriftrace.measuring.fit.shift_mixture import ShiftMixture
from iriftrace.part.part import part_of_mesh
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.provenance import provenance
from validation.inputs.cameras import camera_at
from validation.inputs.hot_block import AMBIENT
from validation.inputs.leaning_air import BOARD, BOARD_CAMERA, UPRIGHT, measured_shifts

pytestmark = [
    pytest.mark.usefixtures("variant"),
    pytest.mark.filterwarnings("ignore:The field has no cavity"),
]

RADIUS = 6.0
NOISE = 0.02
LEANS = (0.0, 0.2, 0.4, 0.6)


def air(
    folder: Path, lean: float, *, contrast: float = 1.0, second_k: float = 0.0
) -> iriftrace.IndexField:
    """A layer and a plume, K above the ambient air, also inside of the part; and a second plume."""
    axes = [np.linspace(-18.0, end, n) for end, n in ((42.0, 21), (18.0, 13), (42.0, 21))]
    grid = pv.StructuredGrid(*np.meshgrid(*axes, indexing="ij")).cast_to_unstructured_grid()
    x, y, z = np.asarray(grid.points).T
    off = np.hypot(np.maximum(np.hypot(x, y) - RADIUS, 0.0), np.maximum(np.abs(z) - RADIUS, 0.0))
    around = np.exp(-off / 3.0) * np.maximum(1.0 - off / 11.0, 0.0)
    height = np.maximum(z - RADIUS, 0.0)
    across = (x - lean * height) ** 2 + y**2
    plume = height / (height + 4.0) * np.exp(-across / (2.0 * (4.0 + 0.05 * height) ** 2))
    plume *= np.maximum(1.0 - (height / 34.0) ** 2, 0.0)
    beside = np.exp(-((x - 20.0) ** 2 + (y + 5.0) ** 2) / 32.0)
    beside *= np.maximum(1.0 - np.abs(z - 10.0) / 30.0, 0.0)
    whole = pv.UnstructuredGrid()
    whole.copy_structure(grid)
    whole.point_data["T"] = (
        AMBIENT + contrast * (700.0 * around + 450.0 * plume) + second_k * beside
    )
    file = folder / f"{lean:g}_{contrast:g}_{second_k:g}.vtu"
    whole.save(file)
    return iriftrace.read_field(file)


@pytest.fixture(scope="module")
def part() -> iriftrace.Part:
    mesh = trimesh.creation.cylinder(RADIUS, 2.0 * RADIUS, sections=256)
    return part_of_mesh(np.asarray(mesh.vertices), np.asarray(mesh.faces), name="cylinder")


@pytest.fixture(scope="module")
def board(part: iriftrace.Part, tmp_path_factory: pytest.TempPathFactory) -> iriftrace.Scene:
    """The board behind the cylinder, in the air of the members."""
    folder = tmp_path_factory.mktemp("fields")
    members = iriftrace.HotAir([air(folder, lean) for lean in LEANS])
    behind = BOARD.part.transformed(UPRIGHT)
    return iriftrace.Scene(behind, members, BOARD_CAMERA, blockers=[part], engine="cells")


def measuring(part: iriftrace.Part, hot_air: iriftrace.HotAir) -> iriftrace.Scene:
    """Two devices that look from above past the plume."""
    first, second = (
        camera_at((55.0, y, 70.0), (0.0, 0.0, 0.0), focal_length_mm=20.0, resolution=(36, 30))
        for y in (-25.0, 25.0)
    )
    return iriftrace.Scene(part, hot_air, first, second, "camera_2", engine="cells")


def diameter(points: np.ndarray) -> float:
    """Least squares (Kasa, 1976)."""
    rows = np.column_stack((2.0 * points[:, :2], np.ones(len(points))))
    x, y, rest = np.linalg.lstsq(rows, (points[:, :2] ** 2).sum(axis=1), rcond=None)[0]
    return 2.0 * float(np.sqrt(rest + x**2 + y**2))


def of_the_mantle(
    board: iriftrace.Scene,
    part: iriftrace.Part,
    truth: iriftrace.IndexField,
    weights: MemberWeights,
) -> tuple[float, float, np.ndarray, np.ndarray]:
    """Error and U of the corrected diameter, and of the points along the normal, mm."""
    scan = iriftrace.measure(measuring(part, iriftrace.HotAir(truth)))
    mantle = np.abs(scan.normal[:, 2]) < 0.1
    measured, true, normal = scan.points[mantle], scan.true[mantle], scan.normal[mantle]
    fields = [state.field for state in board.air.states]
    effects = np.array(
        [
            measured - iriftrace.correct(measured, measuring(part, iriftrace.HotAir(one))).points
            for one in fields
        ]
    )
    corrected = measured - weights.mean(effects)
    sizes = diameter(measured) - np.array([diameter(measured - effect) for effect in effects])
    error = diameter(measured) - weights.mean(sizes) - diameter(true)
    along = np.einsum("ij,ij->i", corrected - true, normal)
    u = weights.uncertainty(np.einsum("kij,ij->ki", effects, normal))
    return float(error), 2.0 * float(weights.uncertainty(sizes)), along, 2.0 * u


@pytest.mark.parametrize(
    "truth",
    [{"lean": -0.4}, {"lean": 0.3, "contrast": 1.5}],
    ids=["lean", "contrast"],
)
def test_u_covers_where_members_have_hot_air(
    board: iriftrace.Scene, part: iriftrace.Part, tmp_path: Path, truth: dict[str, float]
) -> None:
    field = air(tmp_path, **truth)
    fit = iriftrace.fit_members(
        board, measured_shifts(attrs.evolve(board, air=iriftrace.HotAir(field)), NOISE)
    )
    assert not fit.contained
    assert fit.birge == pytest.approx(fit.residual / fit.noise)
    assert fit.noise == pytest.approx(NOISE, rel=0.2)
    error, expanded, along, of_points = of_the_mantle(board, part, field, fit.weights)
    assert abs(error) <= expanded
    assert np.mean(np.abs(along) <= of_points) > 0.95
    hotter = "Solve next: hotter walls, as the contrast of the air is about 1."
    assert fit.solve_next.startswith(hotter) == ("contrast" in truth)


@pytest.mark.slow
def test_where_no_member_has_hot_air_the_verdict_says_so(
    board: iriftrace.Scene, part: iriftrace.Part, tmp_path: Path
) -> None:
    """A second plume, through which the devices look: no factor of the members' U covers it."""
    field = air(tmp_path, 0.3, second_k=400.0)
    fit = iriftrace.fit_members(
        board, measured_shifts(attrs.evolve(board, air=iriftrace.HotAir(field)), NOISE)
    )
    *_, along, of_points = of_the_mantle(board, part, field, fit.weights)
    assert np.mean(np.abs(along) <= of_points) < 0.5
    assert fit.verdict.startswith("Air outside the members: the residual of")
    assert "of the dots move farther than in any member" in fit.verdict
    assert fit.solve_next.endswith("and other bodies that stand in the hall.")
    fields = [state.field for state in board.air.states]
    scene = measuring(part, iriftrace.HotAir(fields, weights=fit.weights)).ready
    assert provenance(scene, scene.camera)["assumptions"]["outside_members"] == fit.verdict
    points = iriftrace.measure(measuring(part, iriftrace.HotAir(field))).points
    with pytest.warns(IriftraceWarning, match="are corrected by the members' mean"):
        found = iriftrace.correct(
            points, measuring(part, iriftrace.HotAir(fields, weights=fit.weights))
        )
    sizes = [each.size.uncertainty for each in found.features(part) if each.size.uncertainty]
    assert sizes
    assert all(u.missing[-1] == "air outside the members" for u in sizes)


def test_noise_is_widened_by_the_birge_ratio() -> None:
    """Noise of three times the stated one; against (X^T X)^-1 chi^2 / f in all directions."""
    random = np.random.default_rng(7)
    predicted = random.normal(size=(3, 400, 2))
    weights = np.array((0.2, 0.3, 0.5))
    noisy = np.tensordot(weights, predicted, axes=1) + random.normal(0.0, 0.3, (400, 2))
    fit = ShiftMixture(predicted, noisy)
    assert fit.residual / 0.1 == pytest.approx(3.0, rel=0.1)
    columns = predicted.reshape(3, -1).T
    along = np.array(((1.0, -1.0, 0.0), (0.0, 1.0, -1.0))).T
    textbook = 0.1**2 * np.linalg.inv(along.T @ columns.T @ columns @ along)
    widened = (fit.residual / 0.1) ** 2 * along @ textbook @ along.T
    found = fit.covariance(0.1)
    for effects in random.normal(size=(50, 3)):
        assert effects @ found @ effects >= 0.99 * (effects @ widened @ effects)


@pytest.mark.slow
def test_command(
    board: iriftrace.Scene, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The scene is written all the same, and results of it say that the air is outside.

    A second fit, to air that the members contain, takes the remark away.
    """
    scene = board.save(tmp_path / "board" / "scene.xml").path
    words = ["fit", str(scene), str(tmp_path / "s.csv")]
    for lean in (1.0, 0.3):
        truth = attrs.evolve(board, air=iriftrace.HotAir(air(tmp_path, lean)))
        shifts = measured_shifts(truth, NOISE)
        np.savetxt(
            tmp_path / "s.csv",
            np.column_stack((shifts.places, shifts.shifts)),
            delimiter=",",
            header="u,v,du,dv",
            comments="",
        )
        target = tmp_path / f"fitted_{lean}" / "scene.xml"
        assert main([*words, "-o", str(target)]) == 0
        said = " ".join(capsys.readouterr().err.split())
        written = json.loads(target.with_name("fit.json").read_text())
        loaded = load_scene(target)
        stated = provenance(loaded, loaded.camera)["assumptions"]
        assert written["schema"] == "iriftrace.fit/3"
        assert written["contained"] == (lean == 0.3)
        assert ("Air outside the members" in said) == (lean == 1.0)
        assert stated.get("outside_members", "") == (written["verdict"] if lean == 1.0 else "")
        assert written["solve_next"] in said
        assert bool(written["solve_next"]) == (lean == 1.0)
        words += ["--scene", str(target)]
