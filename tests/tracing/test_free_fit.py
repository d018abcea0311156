"""Numbers of the air from a board's shifts: twins whose contrast, lean and wall are known."""

import json
from pathlib import Path

import attrs
import numpy as np
import pytest

import iriftrace
from iriftrace.cli import main
from iriftrace.core.errors import InputError
from iriftrace.io.measured_shift import MeasuredShift
from iriftrace.measuring.fit.free_fit import _by_wall
from iriftrace.medium.path_data import cells_of
from iriftrace.medium.source import FieldFacts, Variation
from validation.inputs.hot_block import HALF
from validation.inputs.leaning_air import (
    BOARD,
    BOARD_CAMERA,
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
    pytest.mark.filterwarnings("ignore:.*corrected by the members' mean"),
]

LEAN, CONTRAST, NOISE = 0.1, 0.05, 0.05

Fields = tuple[iriftrace.IndexField, iriftrace.IndexField]


@pytest.fixture(scope="module")
def fields(tmp_path_factory: pytest.TempPathFactory) -> Fields:
    """A field, and the air that is measured: its plume leans more, and its contrast is larger."""
    folder = tmp_path_factory.mktemp("fields")
    return leaning(0.2, folder), with_contrast(leaning(0.2 + LEAN, folder), CONTRAST)


def with_contrast(field: iriftrace.IndexField, more: float) -> iriftrace.IndexField:
    ambient = field.ambient_refractivity
    return attrs.evolve(field, refractivity=ambient + (1 + more) * (field.refractivity - ambient))


def board_in(air: iriftrace.HotAir) -> iriftrace.Scene:
    part = BOARD.part.transformed(UPRIGHT)
    return iriftrace.Scene(part, air, BOARD_CAMERA, blockers=[hot_block_part()], engine="cells")


def block_in(air: iriftrace.HotAir) -> iriftrace.Scene:
    camera, second = LEEWARD
    block = hot_block_part()
    return iriftrace.Scene(block, air, camera, second=second, second_id="camera_2", engine="cells")


@pytest.fixture(scope="module")
def shifts(fields: Fields, variant: str) -> MeasuredShift:
    del variant  # which is set
    return measured_shifts(board_in(iriftrace.HotAir(fields[1])), NOISE)


def test_contrast_and_lean_are_found_and_correct_the_part(
    fields: Fields, shifts: MeasuredShift
) -> None:
    """Also where the layer next to the block does not lean, as the model has it."""
    found = iriftrace.fit_free(
        board_in(iriftrace.HotAir(fields[0])), shifts, ["contrast", "lean"], noise_px=NOISE
    )
    truth = {"contrast": CONTRAST, "lean x": LEAN, "lean y": 0.0}
    assert list(found.values) == list(truth)
    for name, value in truth.items():
        assert abs(found.values[name] - value) < 2.0 * found.u[name], name
    assert found.values["contrast"] == pytest.approx(CONTRAST, abs=0.01)
    assert found.values["lean x"] == pytest.approx(LEAN, abs=0.015)
    assert found.u["contrast"] < 0.06
    assert found.u["lean x"] < 0.05
    assert found.u["lean y"] > 3.0 * found.u["lean x"]
    assert found.residual < 1.1 * NOISE < 0.75 * found.before
    scan = iriftrace.measure(block_in(iriftrace.HotAir(fields[1])))
    left = []
    for air in (iriftrace.HotAir(fields[0]), found.air):
        corrected = iriftrace.correct(scan.points, block_in(air))
        good = corrected.corrected
        off = along_normal(hot_block_part(), corrected.points[good], scan.face[good])
        left.append(float(np.sqrt(np.mean(off**2))))
    assert left[1] < 0.2 * left[0]
    assert corrected.u_normal is not None
    assert np.mean(np.abs(off) <= 2.0 * corrected.u_normal[good]) > 0.9


def test_the_wall_is_found_along_the_member_that_varies_it(fields: Fields) -> None:
    """By 20 K, of which the truth has 12; a motion of the camera is told from it."""
    base = fields[0]
    hotter = with_contrast(base, 0.02)
    facts = FieldFacts(variation=Variation("wall", 20.0, base.source.sha256))
    source = attrs.evolve(base.source, sha256="varied", facts=facts)
    air = iriftrace.HotAir([base, attrs.evolve(hotter, source=source)], labels=("a", "b"))
    scene = board_in(air)
    measured = measured_shifts(board_in(iriftrace.HotAir(with_contrast(base, 0.012))), 1e-4)
    found = iriftrace.fit_free(scene, measured, ["wall"], noise_px=1e-4, camera_motion=True)
    assert found.values["wall"] == pytest.approx(12.0, abs=0.3)
    assert found.motions is not None
    assert np.abs(found.motions).max() < 1e-3
    assert found.weights.tolist() == [1.0]


def test_several_walls_count_in_their_mean(fields: Fields) -> None:
    """Of one member 20 K are 2 % of its contrast, of the other 10 K are 4 %."""

    def named(field: iriftrace.IndexField, sha256: str, **facts: object) -> iriftrace.IndexField:
        source = attrs.evolve(field.source, sha256=sha256, facts=FieldFacts(**facts))
        return attrs.evolve(field, source=source)

    one, other = named(fields[0], "1"), named(with_contrast(fields[0], -0.5), "2")
    of_one = named(with_contrast(one, 0.02), "3", variation=Variation("wall", 20.0, "1"))
    of_other = named(with_contrast(other, 0.04), "4", variation=Variation("wall", 10.0, "2"))
    air = iriftrace.HotAir([one, of_one, other, of_other], labels=list("abcd"))
    cells = cells_of(one)
    (by_kelvin,) = _by_wall(board_in(air), [cells])
    mean = 0.5 * (0.02 / 20.0 + 0.5 * 0.04 / 10.0)
    np.testing.assert_allclose(by_kelvin, mean * (cells.refractivity - cells.ambient), atol=1e-12)


def test_other_air_is_told(fields: Fields, shifts: MeasuredShift) -> None:
    """Another contrast does not explain the lean when the dots have little noise."""
    with pytest.warns(iriftrace.IriftraceWarning, match="Air outside these numbers"):
        found = iriftrace.fit_free(
            board_in(iriftrace.HotAir(fields[0])), shifts, ["contrast"], noise_px=0.02
        )
    assert found.air.notes["outside_members"].startswith("Air outside")
    assert found.u["contrast"] > 0.05


def test_what_cannot_be_fitted_is_refused(fields: Fields, shifts: MeasuredShift) -> None:
    scene = board_in(iriftrace.HotAir(fields[0]))
    for free, code in ((["wall"], "fit.no_wall_member"), (["field"], "fit.unknown_number")):
        with pytest.raises(InputError) as refused:
            iriftrace.fit_free(scene, shifts, free)
        assert refused.value.code == code
        assert refused.value.argument == "free"
    with pytest.raises(InputError) as refused:
        iriftrace.fit_free(scene, attrs.evolve(shifts, resolution=(1200, 1000)), ["contrast"])
    assert refused.value.code == "shifts.other_size"


@pytest.mark.filterwarnings("ignore:The field has no cavity")
def test_air_around_no_cavity_has_a_contrast_but_leans_from_nothing(fields: Fields) -> None:
    """A field of the air above the block alone."""
    base = fields[0]
    centres = np.asarray(base.grid.cell_centers().points)
    above = base.grid.extract_cells(np.flatnonzero(centres[:, 2] > HALF))
    index = base.refractivity[np.asarray(above.point_data["vtkOriginalPointIds"])]
    open_air = iriftrace.IndexField(above, index, base.air, base.source)
    assert not open_air.wall.n_points
    measured = measured_shifts(board_in(iriftrace.HotAir(with_contrast(open_air, CONTRAST))), NOISE)
    scene = board_in(iriftrace.HotAir(open_air))
    found = iriftrace.fit_free(scene, measured, ["contrast"], noise_px=NOISE)
    assert found.values["contrast"] == pytest.approx(CONTRAST, abs=0.01)
    with pytest.raises(InputError) as refused:
        iriftrace.fit_free(scene, measured, ["lean"], noise_px=NOISE)
    assert refused.value.code == "field.no_wall"


def test_the_command_writes_the_changed_air(
    fields: Fields, shifts: MeasuredShift, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    board = board_in(iriftrace.HotAir(fields[0], layers=9))
    xml = board.save(tmp_path / "board" / "scene.xml", scale=0.25)
    rows = np.hstack((shifts.places, shifts.shifts))
    np.savetxt(tmp_path / "s.csv", rows, delimiter=",", header="u,v,du,dv", comments="")
    out = tmp_path / "fitted" / "scene.xml"
    words = ["fit", str(Path(xml)), str(tmp_path / "s.csv"), "-o", str(out)]
    assert main([*words, "--free", "contrast", "--noise", "0.05"]) == 0
    assert "Numbers of the air" in capsys.readouterr().out
    values = json.loads(out.with_name("fit.json").read_text())
    fitted = iriftrace.load_scene(out)
    assert fitted.camera.resolution == board.camera.scaled(0.25).resolution
    assert iriftrace.load_scene(out, {"scale": 1}).camera.resolution == board.camera.resolution
    assert [one.label for one in fitted.members] == ["fitted", "fitted contrast + u"]
    assert [len(state.shells.shells) for state in fitted.air.states] == [9, 9]
    first, second = (state.cells for state in fitted.air.states)
    stated = f"changed by a fit (contrast {values['values']['contrast']:.4g})"
    assert first.source.origin.endswith(stated)
    peak = np.abs(first.refractivity - first.ambient).max()
    more = np.abs(second.refractivity - second.ambient).max() / peak - 1.0
    assert more == pytest.approx(values["u"]["contrast"] / (1 + values["values"]["contrast"]), 0.01)
    assert main([*words, "--free", "field"]) == 2
    assert "--free" in capsys.readouterr().err
    # A file written by hand may have no parameter for the resolution.
    text = Path(xml).read_text(encoding="utf-8")
    text = text.replace('<default name="scale" value="0.25"/>', "").replace("$scale", "0.25")
    Path(xml).write_text(text, encoding="utf-8")
    words[-1] = str(tmp_path / "again" / "scene.xml")
    assert main([*words, "--free", "contrast", "--noise", "0.05"]) == 0
    assert iriftrace.load_scene(words[-1]).camera.resolution == fitted.camera.resolution
