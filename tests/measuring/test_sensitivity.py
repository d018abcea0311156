"""Derivatives of diameters by the air against differences of fits and of whole measurements."""

import json
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from attrs import evolve

import iriftrace
from iriftrace.cli import main
from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.figures.sensitivity import sensitivity_figure
from iriftrace.figures.style import FAINT
from iriftrace.io.field_npz import load_field_file
from iriftrace.measuring.features.feature import Feature
from iriftrace.measuring.features.fit import fit_feature
from iriftrace.measuring.features.size_gradient import size_gradient
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.path_data import FieldCells
from iriftrace.medium.source import FieldFacts, Variation
from iriftrace.scenes import folder_of
from iriftrace.tracing.scene import Scene
from iriftrace.tracing.second_options import System

LATERAL = "cylinder:lateral"


def arc(kind: str, rng: np.random.Generator) -> np.ndarray:
    """Noisy points (n, 3), mm, on a part of a feature of diameter 27 mm."""
    angle, height = rng.uniform(-0.9, 0.9, 400), rng.uniform(-1.0, 1.0, 400)
    outward = np.stack((np.cos(angle), np.sin(angle), 0 * angle), axis=1)
    if kind == "sphere":
        outward = np.stack((np.cos(angle), np.sin(angle), height), axis=1)
        outward /= np.linalg.norm(outward, axis=1)[:, None]
    radius = 13.5 + (4.0 if kind == "cone" else 0.0) * height
    points = radius[:, None] * outward
    if kind in ("cylinder", "cone"):
        points[:, 2] += 20.0 * height
    return np.array((3.0, -2.0, 1.0)) + points + rng.normal(scale=1e-3, size=points.shape)


def diameter(points: np.ndarray, near: Feature) -> float:
    """That of a fit; of a cone at the height of another one's position."""
    found = fit_feature(points, near.kind, near=near)
    size = (found.at(near.position) if near.kind == "cone" else found).size_mm
    assert size is not None
    return size


@pytest.mark.parametrize("kind", ["cylinder", "cone", "sphere", "circle"])
def test_a_diameter_follows_its_points_as_the_fit_does(kind: str) -> None:
    """Against central differences along smooth errors and noise."""
    rng = np.random.default_rng(5)
    points = arc(kind, rng)
    found = fit_feature(points, kind)
    gradient = size_gradient(found, points)
    smooth = np.sin(points / 7.0)
    for change in (smooth, rng.normal(size=points.shape)):
        ends = [diameter(points + step * change, found) for step in (1e-4, -1e-4)]
        expected = (ends[0] - ends[1]) / 2e-4
        assert abs(expected) > 0.02
        assert np.sum(gradient * change) == pytest.approx(expected, rel=3e-3)
    rigid = np.cross((0.01, -0.02, 0.03), points) + np.array((1.0, 2.0, 3.0))
    across = rigid if kind != "cone" else np.array((1.0, 2.0, 0.0)) + 0.0 * points
    assert abs(np.sum(gradient * across)) < 1e-3


def test_a_plane_has_no_diameter() -> None:
    points = np.random.default_rng(1).normal(size=(50, 3)) * (5.0, 5.0, 1e-3)
    with pytest.raises(InputError, match="no diameter"):
        size_gradient(fit_feature(points, "plane"), points)


@pytest.fixture(scope="module")
def air() -> FieldCells:
    return load_field_file(folder_of("cylinder") / "field.npz")


@pytest.fixture(scope="module")
def shells(variant: str) -> Scene:
    """Two devices; the cylinder is that of the field."""
    xml = folder_of("fringe_cylinder") / "scene.xml"
    return iriftrace.load_scene(xml, {"scale": 0.05}, variant=variant)


def smooth_changes(air: FieldCells, distance: np.ndarray) -> dict[str, np.ndarray]:
    """Changes of the temperature, K: 1 % of the excess, times smooth factors."""
    kelvin = air.air.temperature(air.refractivity)
    ambient = air.air.temperature_k
    part = 0.01 * (kelvin - ambient)
    along = air.points[:, 0].astype(np.float64)
    return {
        "contrast": part * kelvin / ambient,
        "near the part": part * np.exp(-distance / 3.0),
        "along the axis": part * np.cos(along / 20.0),
    }


@pytest.mark.slow
@pytest.mark.parametrize(
    ("system", "feature", "bound"),
    [("fringe", LATERAL, 2e-3), ("stereo", LATERAL, 2e-3), ("laser", "circle:lateral", 1e-2)],
)
def test_a_measured_diameter_follows_the_air_as_whole_measurements_do(
    shells: Scene, air: FieldCells, system: System, feature: str, bound: float
) -> None:
    """Measured anew in changed air at the same pixels, with the same inliers."""
    found = iriftrace.sensitivity(shells.through(air), feature, system=system)
    kind = feature.split(":", maxsplit=1)[0]
    (fitted,) = found.scan.features(shells.part, [feature])
    kelvin = air.air.temperature(air.refractivity)
    for name, change in smooth_changes(air, found.distance).items():
        sizes = []
        for sign in (1.0, -1.0):
            hotter = evolve(air, refractivity=air.air.refractivity(kelvin + sign * change))
            scan = iriftrace.measure(shells.through(hotter), system=system)
            np.testing.assert_array_equal(scan.status, found.scan.status)
            sizes.append(fit_feature(scan.points[fitted.rows], kind).size_mm)
        difference = 0.5 * (sizes[0] - sizes[1])
        assert abs(difference) > 1e-6, name
        assert found.gradient @ change == pytest.approx(difference, rel=bound), name


def test_effects_are_those_of_the_members(shells: Scene, air: FieldCells) -> None:
    """Members whose contrast is 2 % more and 3 % less; the effect of all of it is the error."""

    def field(number: int, factor: float, varied: bool) -> IndexField:
        facts = FieldFacts(variation=Variation("wall", 10.0, "0") if varied else None)
        source = evolve(air.source, sha256=str(number), facts=facts)
        excess = factor * (air.refractivity - air.ambient)
        return IndexField(air.grid(), air.ambient + excess, air.air, source)

    fields = [field(0, 1.0, False), field(1, 1.02, True), field(2, 0.97, False)]
    hot = iriftrace.HotAir(fields, labels=("still", "hot wall", "draught"), weights=(2, 1, 1))
    scene = Scene(
        part=shells.part,
        air=hot,
        camera=shells.camera,
        second=shells.second,
        engine="cells",
        variant=shells.variant,
    )
    found = iriftrace.sensitivity(scene, LATERAL)
    one, wall, draught = found.effects.values()
    assert list(found.effects)[1:] == ["hot wall (varies wall by 10 K)", "draught"]
    assert wall == pytest.approx(2.0 * one, rel=1e-3)
    assert draught == pytest.approx(-3.0 * one, rel=1e-3)
    assert 100.0 * one == pytest.approx(found.measured_mm - found.cold_mm, rel=0.03)
    near, far = found.within(0.5), found.within(0.95)
    assert 0.0 < near < far < 30.0
    inside = np.abs(found.of_air[found.distance <= near]).sum()
    assert inside == pytest.approx(0.5 * np.abs(found.of_air).sum(), rel=0.02)
    (body,) = sensitivity_figure(found, scene.part).subfigs
    (hexagons,) = body.axes[0].collections
    sums, limit = hexagons.get_array(), hexagons.norm.vmax
    assert sums.mask.any()  # the part is seen where there is no effect
    assert np.abs(sums.compressed()).min() >= FAINT * limit


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A scene of two devices with its field file."""
    cylinder, fringe = folder_of("cylinder"), folder_of("fringe_cylinder")
    for name in ("field.npz", "part.ply"):
        (tmp_path / name).write_bytes((cylinder / name).read_bytes())
    xml = (fringe / "scene.xml").read_text().replace("../cylinder/", f"{cylinder}/")
    (tmp_path / "scene.xml").write_text(xml)
    return tmp_path


@pytest.mark.usefixtures("variant")
def test_the_command_writes_field_numbers_and_picture(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = folder / "out.vtu"
    words = ["sensitivity", str(folder / "scene.xml"), "-D", "scale=0.05", "-o", str(out)]
    assert main([*words, "--feature", LATERAL]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    numbers = json.loads(out.with_suffix(".json").read_text())
    assert (
        f"80 % of what moves this diameter lies within {numbers['within_mm']['0.8']:.1f} mm of"
        in (printed)
    )
    data = pv.read(out).point_data
    kelvin = np.asarray(data["T"])
    contrast = 0.01 * kelvin * (kelvin - 293.15) / 293.15
    effect = numbers["effects_mm"]["contrast +1 %"]
    assert 1e-3 * data["d_size_d_T"] @ contrast == pytest.approx(effect, rel=1e-6)
    excess_nm = 1e3 * data["d_size_d_T"] * 0.01 * (kelvin - 293.15)
    np.testing.assert_allclose(data["effect_of_1_percent"], excess_nm, rtol=1e-6, atol=1e-12)
    page = out.with_suffix(".html")
    assert main(["view", str(out), "-o", str(page)]) == 0
    assert "excess temperature (nm)" in page.read_text()
    volume = pv.read(out).compute_cell_sizes().cell_data["Volume"].sum()
    known = data["d_size_d_T_per_cm3"] != 0.0
    by_point = 1e3 * data["d_size_d_T"][known] / data["d_size_d_T_per_cm3"][known]
    assert by_point.min() > 0.0
    assert 0.05 * volume < by_point.sum() < 1.0001 * volume
    assert out.with_suffix(".png").stat().st_size > 10_000


@pytest.mark.usefixtures("variant")
@pytest.mark.parametrize("features", [[], ["--feature", LATERAL, "--feature", "circle:lateral"]])
def test_the_command_needs_one_feature(
    folder: Path, features: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["sensitivity", str(folder / "scene.xml"), *features]) == 2
    assert "--feature" in capsys.readouterr().err


def test_a_feature_that_was_not_measured_is_refused(shells: Scene, air: FieldCells) -> None:
    with (
        pytest.warns(IriftraceWarning, match="plane is left out"),
        pytest.raises(InputError, match="not one feature"),
    ):
        iriftrace.sensitivity(shells.through(air), "plane")
