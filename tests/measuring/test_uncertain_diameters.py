"""Uncertainty of diameters as the commands state it, of one field and of several."""

import json
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from attrs import evolve

from iriftrace.cli import main
from iriftrace.core.errors import InputError
from iriftrace.figures.answer import digits_of
from iriftrace.measuring.two_devices.budget import feature_budget
from iriftrace.measuring.two_devices.correct import correct
from iriftrace.measuring.two_devices.correction_status import CorrectionStatus
from iriftrace.measuring.two_devices.measure import measure
from iriftrace.measuring.two_devices.scan import Scan
from iriftrace.measuring.uncertainty.air_groups import AIR, CONTRAST
from iriftrace.measuring.uncertainty.decision import Tolerance
from iriftrace.measuring.uncertainty.inputs import Inputs
from iriftrace.scenes import folder_of
from iriftrace.tracing.load import load_scene
from validation.inputs import hot_block

FRINGE = folder_of("fringe_cylinder") / "scene.xml"

Printed = pytest.CaptureFixture[str]


@pytest.fixture(scope="module")
def fringe(variant: str, tmp_path_factory: pytest.TempPathFactory) -> tuple[Scan, Path]:
    """A scan of the bundled cylinder, and its file."""
    scan = measure(load_scene(FRINGE, {"scale": 0.1}, variant=variant))
    return scan, scan.save(tmp_path_factory.mktemp("fringe") / "scan.vtp")[0]


def test_a_diameter_has_the_uncertainty_of_its_correction(
    fringe: tuple[Scan, Path], tmp_path: Path, capsys: Printed
) -> None:
    """5 % of the field are 5 % of what was taken out; U is twice that."""
    scan, corrected = fringe[1], tmp_path / "corrected.vtp"
    words = ["correct", str(scan), str(FRINGE), "-o", str(corrected), "--no-figures"]
    assert main(words) == 0
    said = capsys.readouterr().out
    assert "The air's part of U is not known" in said
    assert "U = at least " in said
    for file in (scan, corrected):
        numbers = json.loads(file.with_suffix(".json").read_text())
        assert numbers["field"]["sha256"]
    assert "u_normal" not in pv.read(corrected).point_data
    assert main([*words, "--uncertainty=air 5 %"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    row = next(
        row
        for row in json.loads(corrected.with_suffix(".json").read_text())["features"]
        if row["kind"] == "cylinder"
    )
    air = row["size_mm"]["corrected"] - row["size_mm"]["measured"]
    u = {part["group"]: part["u_mm"] for part in row["contributions"]}
    assert u == {
        CONTRAST: pytest.approx(0.05 * abs(air), rel=1e-9),
        "sensor": row["u_size_mm"]["corrected"],
    }
    assert list(u) == sorted(u, key=lambda group: -u[group])
    total = 2 * np.hypot(*u.values())
    assert row["U_mm"] == pytest.approx(total, rel=1e-9)
    assert row["value_mm"] == row["size_mm"]["corrected"]
    assert (row["k"], row["not_covered"]) == (pytest.approx(2.0), [])
    assert row["interval_mm"] == pytest.approx([row["value_mm"] - total, row["value_mm"] + total])
    places = digits_of(total)
    stated = f"corrected: {row['value_mm']:.{places}f} mm, U = {total:.{places}f} mm (k = 2, "
    assert stated in said
    assert "nothing is decided" not in said
    assert len(said.splitlines()) <= 15
    points = pv.read(corrected).point_data
    assert (points["u"] >= points["u_normal"] - 1e-12).all()
    assert pv.read(corrected).point_data["u_normal"].max() > 0
    assert main([*words, "--uncertainty=air 150 %"]) == 2
    assert main([*words, "--uncertainty=air much"]) == 2
    assert 'write it like "air 5 %"' in " ".join(capsys.readouterr().err.split())


def test_noise_may_leave_more_of_a_diameter_than_the_air_does(
    fringe: tuple[Scan, Path], tmp_path: Path, capsys: Printed
) -> None:
    """Noise of 0.2 mm, of which 150 points leave more of the diameter than air does."""
    scan, _ = fringe
    rng = np.random.default_rng(1)
    chosen = rng.choice(len(scan.points), 400, replace=False)
    points = scan.points[chosen] + rng.normal(0, 0.2, (400, 3))
    points[:8] += 0.7 * scan.normal[chosen[:8]]
    cloud = tmp_path / "cloud.xyz"
    np.savetxt(cloud, points, "%.9g")
    words = ["correct", str(cloud), str(FRINGE), "-o", str(tmp_path / "c.vtp"), "--no-figures"]
    words += ["--feature=cylinder:lateral", "--uncertainty=air 5 %"]
    assert main(words) == 0
    said = " ".join(capsys.readouterr().out.split())
    (row,) = json.loads((tmp_path / "c.json").read_text())["features"]
    sizes = row["size_mm"]
    assert row["U_mm"] > abs(sizes["corrected"] - sizes["measured"])
    assert main([*words, "--gate=2"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert " left out as outliers" in said
    assert main([*words, "--gate=none"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "left out" not in said
    (row,) = json.loads((tmp_path / "c.json").read_text())["features"]
    assert f"; {row['points']} points" in said
    assert main([*words, "--gate=0.1"]) == 2
    assert "at least 1, or none for all points" in " ".join(capsys.readouterr().err.split())


def test_air_from_formulas_has_no_uncertainty(
    tmp_path: Path, capsys: Printed, variant: str
) -> None:
    """Of a size, whatever is stated of the field: it is null, and said to be missing."""
    part, field = tmp_path / "part.ply", tmp_path / "field.vtu"
    view = ["--origin=0,-150,120", "--target=0,0,0", "--second=60,-150,120", "--focus=10:500"]
    xml, scan = tmp_path / "s" / "scene.xml", tmp_path / "scan.vtp"
    for words in (
        ["part", "cylinder", "-o", str(part)],
        ["field", "synthetic", str(part), "-o", str(field), "--cell-size=7 mm"],
        ["scene", str(field), str(part), "-o", str(xml), "--layers=5", *view],
        ["measure", str(xml), "-o", str(scan), "-D", "scale=0.05", "--no-figures"],
        ["correct", str(scan), str(xml), "-o", str(tmp_path / "c.vtp"), "--uncertainty=air 5 %"],
    ):
        assert main(words) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "U = at least " in said
    assert "; not covered: air around the part)" in said
    assert "use a flow solution" in said
    (row, *_) = [
        row
        for row in json.loads((tmp_path / "c.json").read_text())["features"]
        if row["kind"] == "cylinder"
    ]
    assert row["not_covered"] == [AIR]
    assert [part["group"] for part in row["contributions"]] == ["sensor"]
    assert row["U_mm"] > 0


@pytest.mark.slow
@pytest.mark.usefixtures("variant")
def test_several_fields_become_a_scene_with_two_devices(tmp_path: Path, capsys: Printed) -> None:
    field, part = hot_block.save(tmp_path)
    cooler = pv.read(field)
    cooler.point_data["T"] = 293.15 + 0.8 * (cooler.point_data["T"] - 293.15)
    cooler.save(tmp_path / "cooler.vtu")
    xml, cloud = tmp_path / "scene" / "scene.xml", tmp_path / "scan.vtp"
    words = ["scene", str(field), str(part), "-o", str(xml), "--layers=3", *hot_block.CAMERA]
    words.append(f"--member={tmp_path / 'cooler.vtu'}")
    assert main([*words, "--second=1,0,0"]) == 2
    assert main([*words, "--second=75,-20,70"]) == 0
    assert "what both measure" in " ".join(capsys.readouterr().out.split())
    assert main(["measure", str(xml), "-o", str(cloud)]) == 0
    numbers = json.loads(cloud.with_suffix(".json").read_text())
    assert numbers["scatter_normal_mm"]["median"] > 0
    assert "scatter_normal" in pv.read(cloud).point_data
    assert main(["correct", str(cloud), str(xml), "-o", str(tmp_path / "c.vtp")]) == 0
    found = json.loads((tmp_path / "c.json").read_text())
    assert found["u_normal_mm"]["median"] > 0


def test_a_field_that_ends_at_the_feature_leaves_its_diameter_undecided(
    fringe: tuple[Scan, Path], variant: str
) -> None:
    """Where points are seen through no known hot air, that of their neighbours is cut off, too."""
    scene = load_scene(FRINGE, {"scale": 0.1}, variant=variant)
    tolerance = {"cylinder:lateral": Tolerance(27.0, -0.1, 0.1)}
    found = correct(fringe[0].points, scene, inputs=Inputs(air=0.05, sensor_mm=0.001))
    for share, missing in ((0.04, ()), (0.1, ("air beyond the data",))):
        status = found.status.copy()
        status[: int(share * len(status))] = CorrectionStatus.OUTSIDE_FIELD
        cut = evolve(found, status=status)
        (lateral,) = cut.features(scene.part, ["cylinder:lateral"], tolerances=tolerance)
        assert lateral.size.uncertainty is not None
        assert lateral.size.decision is not None
        assert lateral.doubts == missing
        assert set(missing) <= set(lateral.size.uncertainty.missing)
        assert lateral.size.decision.verdict == ("not decided" if missing else "accepted")


def test_a_budget_without_a_sensor_decides_nothing(variant: str) -> None:
    """Its points have no noise, and what they leave about a cylinder is the chord of its mesh."""
    scene = load_scene(FRINGE, {"scale": 0.1}, variant=variant)
    tolerance = {"cylinder:lateral": Tolerance(27.0, -0.1, 0.1)}
    for sensor_mm, missing in ((None, ("sensor",)), (0.001, ())):
        stated = Inputs(air=0.05, sensor_mm=sensor_mm)
        (lateral,) = feature_budget(scene, stated, tolerances=tolerance).features
        assert lateral.size.uncertainty is not None
        assert lateral.size.decision is not None
        assert lateral.size.uncertainty.missing == missing
        assert ("sensor" in lateral.size.uncertainty.parts) is not bool(missing)
        assert lateral.size.decision.verdict == ("not decided" if missing else "accepted")


def test_the_uncertainty_of_no_growth_is_refused(fringe: tuple[Scan, Path], variant: str) -> None:
    """The scene does not say how much this part has grown, so no size depends on it."""
    scene = load_scene(FRINGE, {"scale": 0.1}, variant=variant)
    stated = Inputs(expansion=0.02, part_temperature_k=10.0)
    for make in (
        lambda: feature_budget(scene, stated),
        lambda: correct(fringe[0].points, scene, inputs=stated),
    ):
        with pytest.raises(InputError, match="expansion and part is stated") as error:
            make()
        assert error.value.code == "uncertainty.of_no_growth"
