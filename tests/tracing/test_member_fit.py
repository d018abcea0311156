"""Weights of members from a board's shifts: a twin experiment in air of a formula, and by command.

The truth lies between two members; the shifts of the dots have noise of 0.05 px.
"""

import json
from pathlib import Path

import attrs
import numpy as np
import pytest
import pyvista as pv

import iriftrace
from iriftrace.cli import main
from iriftrace.core.errors import InputError
from iriftrace.io.measured_shift import MeasuredShift
from iriftrace.measuring.camera_motion import interaction_matrix
from iriftrace.measuring.two_devices.correction_status import CorrectionStatus
from iriftrace.medium.source import FieldFacts, Variation
from iriftrace.tracing.load import load_scene
from validation.inputs.leaning_air import (
    ACROSS,
    BOARD,
    BOARD_CAMERA,
    CAMERA_ACROSS,
    LEEWARD,
    UPRIGHT,
    along_normal,
    hot_block_part,
    leaning,
    measured_shifts,
)

pytestmark = [
    pytest.mark.usefixtures("variant"),
    pytest.mark.filterwarnings("ignore:Hits of this view"),
]

LEANS = (0.0, 0.2, 0.4, 0.6)
NOISE = 0.05
Printed = pytest.CaptureFixture[str]


@pytest.fixture(scope="module")
def fields(tmp_path_factory: pytest.TempPathFactory) -> list[iriftrace.IndexField]:
    folder = tmp_path_factory.mktemp("fields")
    return [leaning(lean, folder) for lean in LEANS]


@pytest.fixture(scope="module")
def board(fields: list[iriftrace.IndexField]) -> iriftrace.Scene:
    """The board behind the block, in the air of the members."""
    part = BOARD.part.transformed(UPRIGHT)
    air = iriftrace.HotAir(fields, layers=9)
    return iriftrace.Scene(part, air, BOARD_CAMERA, blockers=[hot_block_part()], engine="shells")


def in_air(scene: iriftrace.Scene, field: iriftrace.IndexField) -> iriftrace.Scene:
    return attrs.evolve(scene, air=iriftrace.HotAir(field, layers=9))


def of_part(scene: iriftrace.Scene, air: iriftrace.HotAir) -> iriftrace.Scene:
    """The block measured by two devices to its lee, in some air."""
    camera, second = LEEWARD
    return attrs.evolve(
        scene,
        part=scene.blockers[0],
        air=air,
        camera=camera,
        second=second,
        second_id="camera_2",
        blockers=(),
    )


@pytest.fixture(scope="module")
def true_air(tmp_path_factory: pytest.TempPathFactory) -> iriftrace.IndexField:
    return leaning(0.3, tmp_path_factory.mktemp("truth"))


@pytest.fixture(scope="module")
def shifts(board: iriftrace.Scene, true_air: iriftrace.IndexField) -> MeasuredShift:
    return measured_shifts(in_air(board, true_air), NOISE)


@pytest.fixture(scope="module")
def fit(board: iriftrace.Scene, shifts: MeasuredShift) -> iriftrace.MemberFit:
    return iriftrace.fit_members(board, shifts)


def test_twin(
    board: iriftrace.Scene, true_air: iriftrace.IndexField, fit: iriftrace.MemberFit
) -> None:
    """What the weighted correction leaves, against the block's planes and beside still air's.

    The angle of two of its faces, too, is within U, which is less than what air does to it.
    """
    assert fit.noise == pytest.approx(NOISE, rel=0.1)
    assert fit.contained
    assert fit.ratio < 1.3
    assert 1.8 < fit.weights.effective < 2.2
    assert fit.weights.weights @ LEANS == pytest.approx(0.3, abs=0.02)
    truth = of_part(board, iriftrace.HotAir(true_air, layers=9))
    scan, block = iriftrace.measure(truth), board.blockers[0]

    def left(air: iriftrace.HotAir) -> tuple[float, iriftrace.Correction, np.ndarray]:
        found = iriftrace.correct(scan.points, of_part(board, air))
        good = found.status == CorrectionStatus.CORRECTED
        assert good.mean() > 0.9
        off = along_normal(block, found.points[good], scan.face[good])
        return float(np.sqrt(np.mean(off**2))), found, off

    states = board.air.states
    weighted = iriftrace.HotAir([s.field for s in states], layers=9, weights=fit.weights)
    after, found, off = left(weighted)
    uncorrected = float(np.sqrt(np.mean(scan.error_normal**2)))
    assert after <= 0.25 * uncorrected
    assert after <= 0.25 * left(iriftrace.HotAir(states[0].field, layers=9))[0]
    assert found.u_normal is not None
    u = found.u_normal[found.status == CorrectionStatus.CORRECTED]
    assert np.mean(np.abs(off) <= 2.0 * u) >= 0.9
    assert np.median(u) < 0.3 * uncorrected
    assert "by a fit to a measurement" in found.provenance["assumptions"]["ensemble"]
    features = found.features(block)
    (angle,) = (each.as_dict() for each in found.relations(features))
    measured, corrected = (angle["angle_deg"][name] for name in ("measured", "corrected"))
    total = angle["U_deg"]
    assert abs(corrected - 90.0) < total < 0.5 * abs(measured - corrected)


def test_other_signs_are_told(board: iriftrace.Scene, shifts: MeasuredShift) -> None:
    up = attrs.evolve(shifts, shifts=shifts.shifts * (1.0, -1.0))
    with pytest.warns(iriftrace.IriftraceWarning, match="With the other sign of dv"):
        found = iriftrace.fit_members(board, up, noise_px=NOISE)
    assert found.dots["measured"] == len(shifts.places)


def test_places_that_were_left_out_are_counted(
    board: iriftrace.Scene, shifts: MeasuredShift
) -> None:
    marked = attrs.evolve(shifts, failed=7, zeros=3, resolution=BOARD_CAMERA.resolution)
    dots = iriftrace.fit_members(board, marked).dots
    assert (dots["measured"], dots["failed"], dots["zeros"]) == (len(shifts.places), 7, 3)


def test_each_camera_has_its_own_motion(board: iriftrace.Scene, shifts: MeasuredShift) -> None:
    """The second view is the first one, with a camera that was turned."""
    origin, sight = board.camera.rays(shifts.places)
    reach = (UPRIGHT[1, 3] - origin[:, 1]) / sight[:, 1]
    turned = interaction_matrix(board.camera, origin + reach[:, None] * sight)
    moved = attrs.evolve(shifts, shifts=shifts.shifts + turned[:, :, 4] * 1e-4)
    found = iriftrace.fit_members(board, shifts, others=[(board, moved)], camera_motion=True)
    first, second = (view.motion for view in found.views)
    assert first is not None
    assert second is not None
    np.testing.assert_allclose(turned @ (second - first), turned[:, :, 4] * 1e-4, atol=0.05)
    assert np.abs(turned[:, :, 4] * 1e-4).max() > 0.5


def test_a_motion_of_the_camera_is_told_from_the_air(
    board: iriftrace.Scene, shifts: MeasuredShift
) -> None:
    motion = np.array((0.02, -0.01, 0.03, 1e-4, -2e-4, 3e-4))
    dots = BOARD.centres @ UPRIGHT[:3, :3].T + UPRIGHT[:3, 3]
    nearest = np.argmin(
        np.linalg.norm(BOARD_CAMERA.project(dots)[:, None] - shifts.places, axis=2), axis=0
    )
    moved = interaction_matrix(BOARD_CAMERA, dots[nearest]) @ motion
    both = attrs.evolve(shifts, shifts=shifts.shifts + moved)
    assert not iriftrace.fit_members(board, both).contained
    fit = iriftrace.fit_members(board, both, camera_motion=True)
    assert fit.ratio < 1.3
    assert fit.weights.weights @ LEANS == pytest.approx(0.3, abs=0.03)
    motion_found = fit.views[0].motion
    assert motion_found is not None
    # A turn and a move across the view are seen as nearly the same shift: compare what is seen.
    seen = interaction_matrix(BOARD_CAMERA, dots[nearest]) @ motion_found
    assert np.sqrt(np.mean((seen - moved) ** 2)) < 0.5 * NOISE < np.sqrt(np.mean(moved**2))


@pytest.mark.slow
def test_a_second_board_tells_the_direction(board: iriftrace.Scene, tmp_path: Path) -> None:
    """The plume leans along the first camera's line of sight, too; the second looks across."""
    family = [
        leaning(lean, tmp_path, turn_deg=turn) for turn in (-20, 0, 20) for lean in (0.2, 0.4)
    ]
    true_air = leaning(0.3, tmp_path, turn_deg=10.0)
    views = [
        attrs.evolve(
            board,
            part=BOARD.part.transformed(to_world),
            air=iriftrace.HotAir(family),
            camera=camera,
            engine="cells",
        )
        for to_world, camera in ((UPRIGHT, BOARD_CAMERA), (ACROSS, CAMERA_ACROSS))
    ]
    seen = [
        measured_shifts(in_air(view, true_air), noise, to_world=to_world)
        for view, noise, to_world in zip(
            views, (NOISE, 0.6 * NOISE), (UPRIGHT, ACROSS), strict=True
        )
    ]
    one = iriftrace.fit_members(views[0], seen[0])
    both = iriftrace.fit_members(views[0], seen[0], others=[(views[1], seen[1])])
    assert one.contained
    assert both.ratio < 1.3
    assert both.dots["measured"] == sum(len(shifts.places) for shifts in seen)
    assert [view.noise for view in both.views] == pytest.approx([NOISE, 0.6 * NOISE], rel=0.15)
    assert [view.residual / view.noise for view in both.views] == pytest.approx([1, 1], abs=0.2)

    truth = attrs.evolve(of_part(board, iriftrace.HotAir(true_air)), engine="cells")
    scan = iriftrace.measure(truth)

    def left(fit: iriftrace.MemberFit) -> float:
        air = iriftrace.HotAir(family, weights=fit.weights)
        found = iriftrace.correct(scan.points, attrs.evolve(truth, air=air))
        off = np.einsum("ij,ij->i", found.points - scan.true, scan.normal)
        good = found.status == CorrectionStatus.CORRECTED
        assert found.u_normal is not None
        assert np.mean(np.abs(off[good]) <= 2.0 * found.u_normal[good]) >= 0.9
        return float(np.sqrt(np.mean(off[good] ** 2)))

    assert left(both) < 0.5 * left(one)
    assert left(both) < 0.06 * float(np.sqrt(np.mean(scan.error_normal**2)))
    others = attrs.evolve(views[1], air=iriftrace.HotAir(family[:4]))
    with pytest.raises(InputError, match="other members than"):
        iriftrace.fit_members(views[0], seen[0], others=[(others, seen[1])])


def test_the_engine_is_stated_that_traced_the_members(
    board: iriftrace.Scene, fields: list[iriftrace.IndexField], shifts: MeasuredShift
) -> None:
    """Too few shells, so that the fields' cells are traced."""
    coarse = attrs.evolve(board, air=iriftrace.HotAir(fields, layers=6), engine="auto")
    with pytest.warns(iriftrace.IriftraceWarning, match="field data were traced instead"):
        found = iriftrace.fit_members(coarse, shifts)
    assert found.provenance["engine"] == "cells"


def test_shifts_that_cannot_be_fitted(board: iriftrace.Scene, shifts: MeasuredShift) -> None:
    def refused(words: str, seen: MeasuredShift, scene: iriftrace.Scene = board) -> None:
        with pytest.raises(InputError, match=words):
            iriftrace.fit_members(scene, seen, noise_px=NOISE)

    def some(rows: object, offset: float = 0.0) -> MeasuredShift:
        return attrs.evolve(shifts, places=shifts.places[rows] + offset, shifts=shifts.shifts[rows])

    refused("outside the camera's picture", some(slice(None), 1500.0))
    binned = attrs.evolve(shifts, resolution=(1200, 1000))
    refused("map of 1200 x 1000 pixels, but the camera has 2400 x 2000", binned)
    refused("fewer than the 4 members", some(slice(3)))
    middle = BOARD_CAMERA.project(np.random.default_rng(6).uniform(-4, 4, (40, 3)))
    refused("hides the board", attrs.evolve(shifts, places=middle, shifts=np.zeros((40, 2))))
    aside = board.part.transformed(
        np.array(((1, 0, 0, 60), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1.0)))
    )
    refused("next to the board", shifts, attrs.evolve(board, part=aside))
    front = board.part.transformed(
        np.array(((1, 0, 0, 0), (0, 1, 0, -100), (0, 0, 1, 0), (0, 0, 0, 1.0)))
    )
    refused("in front of the part", shifts, attrs.evolve(board, part=front))
    refused("has one field", shifts, in_air(board, board.air.states[0].field))


def test_a_camera_given_to_a_loaded_scene_is_at_full_resolution(
    board: iriftrace.Scene, shifts: MeasuredShift, fit: iriftrace.MemberFit, tmp_path: Path
) -> None:
    """The file's own scale is that of its own camera; the given one took the pictures."""
    saved = board.save(tmp_path / "board" / "scene.xml", scale=0.25)
    loaded = load_scene(saved, engine="shells")
    given = board.camera.scaled(0.5)
    halved = attrs.evolve(shifts, places=(shifts.places + 0.5) / 2 - 0.5, shifts=shifts.shifts / 2)
    found = iriftrace.fit_members(attrs.evolve(loaded, camera=given), halved)
    np.testing.assert_allclose(found.weights.weights, fit.weights.weights, atol=0.02)


@pytest.mark.slow
def test_command(
    board: iriftrace.Scene,
    shifts: MeasuredShift,
    fit: iriftrace.MemberFit,
    tmp_path: Path,
    capsys: Printed,
) -> None:
    """Files of the board's scene and of the part's; the weighted scenes correct as in memory."""
    xml = attrs.evolve(board, second=LEEWARD[1], second_id="camera_2").save(
        tmp_path / "board" / "scene.xml", scale=0.25
    )
    table = np.column_stack((shifts.places, shifts.shifts))
    np.savetxt(
        tmp_path / "s.csv", table, delimiter=",", header="u,v,du,dv", comments="", fmt="%.9g"
    )
    measuring = of_part(board, board.air).save(tmp_path / "part" / "scene.xml", scale=0.5)
    words = ["fit", str(xml.path), str(tmp_path / "s.csv"), "--engine", "shells", "-o"]
    assert main([*words, str(tmp_path / "fitted" / "scene.xml")]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert "These members reproduce what was measured" in printed
    assert "first blocker, the hot part, is the part of the fitted scene" in printed
    written = json.loads((tmp_path / "fitted" / "fit.json").read_text())
    dots = pv.read(tmp_path / "fitted" / "fit.vtp").point_data
    used = dots["used"] == 1
    left = np.concatenate([dots[f"residual_{axis}"][used] for axis in "uv"])
    assert np.sqrt(np.mean(left**2)) == pytest.approx(written["views"][0]["residual"], rel=1e-9)
    page = tmp_path / "fit.html"
    assert main(["view", str(tmp_path / "fitted" / "fit.vtp"), "-o", str(page)]) == 0
    assert "residual of the fit at the dots (px)" in page.read_text()
    weights = [row["weight"] for row in written["members"]]
    np.testing.assert_allclose(weights, fit.weights.weights, atol=1e-6)
    fitted = load_scene(tmp_path / "fitted" / "scene.xml")
    np.testing.assert_allclose(fitted.part.bounds, board.blockers[0].bounds, atol=1e-5)
    assert fitted.weights.covariance is not None
    assert fitted.second_id == "camera_2"
    other = tmp_path / "by_others" / "scene.xml"
    twice = ["--view", str(xml.path), str(tmp_path / "s.csv")]
    assert main([*words, str(other), "--scene", str(measuring.path), *twice]) == 0
    assert len(json.loads(other.with_name("fit.json").read_text())["views"]) == 2
    scan = iriftrace.measure(load_scene(other, {"member": 2}))
    cloud, corrected = tmp_path / "cloud.vtp", tmp_path / "corrected.vtp"
    scan.save(cloud)
    capsys.readouterr()
    assert main(["correct", str(cloud), str(other), "-o", str(corrected)]) == 0
    numbers = json.loads(corrected.with_suffix(".json").read_text())
    groups = [one for row in numbers["features"] for one in row.get("contributions", ())]
    sources = {one["source"] for one in groups if one["group"] == "air around the part"}
    assert all(source.endswith("fitted to a measurement") for source in sources)
    rows = numbers["ensemble"]["members"]
    assert [row["weight"] for row in rows] == pytest.approx(weights, abs=1e-9)
    assert main([*words, str(tmp_path / "board" / "other.xml")]) == 2
    assert "folder of its own" in " ".join(capsys.readouterr().err.split())


def test_members_that_vary_another_one_are_not_fitted(
    board: iriftrace.Scene,
    fields: list[iriftrace.IndexField],
    shifts: MeasuredShift,
    fit: iriftrace.MemberFit,
    tmp_path: Path,
    capsys: Printed,
) -> None:
    """They keep the weight 0, without a covariance; the fitted scene has them and their base."""

    def varied(number: int) -> iriftrace.IndexField:
        facts = FieldFacts(variation=Variation("wall", 10.0, fields[number].source.sha256))
        one = fields[number]
        return attrs.evolve(one, source=attrs.evolve(one.source, sha256="wall", facts=facts))

    several = [*fields[:1], varied(0), *fields[1:]]
    labels = ["0.0", "wall", "0.2", "0.4", "0.6"]
    air = iriftrace.HotAir(several, layers=9, labels=labels)
    scene = attrs.evolve(board, air=air)
    found = iriftrace.fit_members(scene, shifts)
    places = [0, 2, 3, 4]
    assert found.weights.weights[places] == pytest.approx(fit.weights.weights, abs=1e-9)
    assert found.covariance[np.ix_(places, places)] == pytest.approx(fit.covariance, rel=1e-6)
    assert not found.covariance[1].any()
    assert not found.covariance[:, 1].any()
    assert found.as_dict()["members"][1]["alone"] is None
    assert {1, 2} <= {member.number for member in found.serving}
    saved = scene.save(tmp_path / "board" / "scene.xml")
    table = np.column_stack((shifts.places, shifts.shifts))
    file, fitted = tmp_path / "s.csv", tmp_path / "fitted" / "scene.xml"
    np.savetxt(file, table, delimiter=",", header="u,v,du,dv", comments="", fmt="%.9g")
    assert main(["fit", str(saved.path), str(file), "--engine", "shells", "-o", str(fitted)]) == 0
    assert "wall" not in capsys.readouterr().out
    again = load_scene(fitted)
    (one,) = (member for member in again.members if member.variation is not None)
    assert one.variation.of in {m.source.sha256 for m in again.members if m is not one}
    leans = [0.0 if member is one else float(member.label) for member in again.members]
    assert again.weights.weights @ leans == pytest.approx(0.3, abs=0.02)
    assert one.weight == 0.0
    assert not again.weights.covariance[one.number - 1].any()


def test_one_state_and_its_variations_cannot_be_fitted(
    board: iriftrace.Scene, fields: list[iriftrace.IndexField], shifts: MeasuredShift
) -> None:
    facts = FieldFacts(variation=Variation("wall", 10.0, fields[0].source.sha256))
    varied = attrs.evolve(fields[1], source=attrs.evolve(fields[1].source, facts=facts))
    scene = attrs.evolve(board, air=iriftrace.HotAir([fields[0], varied], layers=9))
    with pytest.raises(InputError) as error:
        iriftrace.fit_members(scene, shifts)
    assert error.value.code == "scene.one_field"
