"""Iso-surfaces as other programs export them, against the spheres that they were made of."""

from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from attrs import evolve
from numpy.testing import assert_allclose, assert_array_equal

from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.core.mesh.transform import parse_transform
from iriftrace.io.iso_surfaces import import_shells
from iriftrace.io.reading import ReadField
from iriftrace.io.shells import save_shells
from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.shells.contour import contour_shells
from iriftrace.medium.shells.table import SmallComponents
from validation.inputs.shell_fields import (
    AIR,
    AMBIENT,
    edge_counts,
    is_wound_consistently,
    signed_volume,
    sphere_field,
)

# Hotter towards the centre; equal steps of n - 1 from ambient on, so that layers are known.
RADII = (30.0, 20.0, 10.0)
STEP = 4e-5
SAMPLE = Path(__file__).parents[1] / "data" / "iso_surfaces" / "three_spheres.vtu"
LEVELS = AMBIENT - STEP * (np.arange(3) + 0.5)
KELVIN = AIR.temperature(LEVELS)


def spheres(
    name: str = "T [K]", values: np.ndarray = KELVIN, *, cells: bool = False
) -> pv.MultiBlock:
    """Three spheres with a value each, every second triangle turned over, in a mixed order."""
    blocks = pv.MultiBlock()
    for i in (1, 2, 0):
        ball = pv.Icosphere(radius=RADII[i], nsub=2)
        faces = np.asarray(ball.regular_faces).copy()
        faces[::2] = faces[::2, ::-1]
        mesh = pv.PolyData.from_regular_faces(ball.points, faces)
        count = mesh.n_cells if cells else mesh.n_points
        (mesh.cell_data if cells else mesh.point_data)[name] = np.full(count, values[i])
        blocks.append(mesh)
    return blocks


def merged(blocks: pv.MultiBlock) -> pv.PolyData:
    return blocks.combine().extract_surface(algorithm="geometry")


def check(stack, fullness: float = 0.9) -> None:
    """The three spheres, outermost first, closed and outward, with layers at equal steps.

    Their triangles have corners on the spheres and hold at least the fraction `fullness` of them.
    """
    assert stack.rule == "imported"
    assert [s.layer for s in stack.shells] == [1, 2, 3]
    assert_allclose([s.refractivity for s in stack.shells], LEVELS, rtol=1e-5)
    assert_allclose([s.ext for s in stack.shells], AMBIENT - STEP * np.arange(3), rtol=1e-5)
    assert_allclose([s.int_ for s in stack.shells], AMBIENT - STEP * np.arange(1, 4), rtol=1e-5)
    for shell, radius in zip(stack.shells, RADII, strict=True):
        assert_allclose(np.linalg.norm(shell.vertices, axis=1), radius, rtol=1e-5)
        assert np.all(edge_counts(shell.faces)[1] == 2)
        assert is_wound_consistently(shell.faces)
        volume = 4 / 3 * np.pi * radius**3
        assert fullness < signed_volume(shell.vertices, shell.faces) / volume < 1


@pytest.mark.parametrize("cells", [True, False])
@pytest.mark.parametrize("name", ["s.vtm", "s.vtp", "s.vtu"])
def test_all_file_types_and_data_of_points_or_cells(tmp_path, name, cells):
    blocks = spheres(cells=cells)
    match name[-1]:
        case "m":
            blocks.save(tmp_path / name)
        case "p":
            merged(blocks).save(tmp_path / name)
        case "u":
            blocks.combine().save(tmp_path / name)
    stack = import_shells(tmp_path / name)
    check(stack)
    assert not stack.has_normals
    assert stack.source.array == "T [K]"
    assert stack.source.quantity == "temperature"
    assert len(stack.source.sha256) == 64


def test_comsols_export_is_read_with_its_quantity_declared():
    declared = ReadField(array="Color", quantity="temperature", temperature_unit="K")
    stack = import_shells(SAMPLE, declared)
    check(stack, 0.8)
    assert (stack.source.array, stack.source.quantity) == ("Color", "temperature")
    # Neither the name nor the values tell what the only array holds.
    for declared in ({}, {"array": "Color"}, {"quantity": "temperature"}):
        with pytest.raises(InputError, match="Color"):
            import_shells(SAMPLE, ReadField(**declared))


@pytest.mark.parametrize(
    ("quantity", "values"),
    [("temperature", KELVIN), ("index", 1.0 + LEVELS), ("index", LEVELS)],
    ids=["kelvin", "index", "refractivity"],
)
def test_declared_quantities(tmp_path, quantity, values):
    merged(spheres("Color", values)).save(tmp_path / "s.vtp")
    declared = ReadField(array="Color", quantity=quantity, temperature_unit="K")
    check(import_shells(tmp_path / "s.vtp", declared))


def test_temperatures_without_a_unit_are_read_in_kelvin_with_a_warning(tmp_path):
    """Surfaces of 300, 600 and 900 degC are possible temperatures in K, too."""
    levels = np.array((300.0, 600.0, 900.0))
    merged(spheres("T", levels)).save(tmp_path / "s.vtp")
    with pytest.warns(
        IriftraceWarning, match="unit of 'T', .* in K: 27 to 627 degC; state"
    ) as said:
        stack = import_shells(tmp_path / "s.vtp")
    assert said[0].message.argument == "temperature_unit"
    kelvins = AIR.temperature(np.array([shell.refractivity for shell in stack.shells]))
    assert_allclose(kelvins, levels, rtol=1e-6)
    import_shells(tmp_path / "s.vtp", ReadField(temperature_unit="degC"))


def test_units_and_transform(tmp_path):
    surface = merged(spheres("Temperature", KELVIN - 273.15))
    surface.points = surface.points / 1000 + [0, 0, 1]
    surface.save(tmp_path / "s.vtp")
    stack = import_shells(
        tmp_path / "s.vtp",
        ReadField(
            temperature_unit="degC",
            length_unit="m",
            transform=parse_transform("translate 0 0 -1000, rotate x 90"),
        ),
    )
    # 1 m is stored in float32, which leaves 6e-5 mm, so the radii are only as good.
    check(stack)
    assert stack.source.length_unit == "m"


def test_own_surfaces_come_back_with_the_same_winding(tmp_path):
    # No gradient is in the file, so the winding follows from the neighbours alone.
    stack = contour_shells(sphere_field(12), layers=4, rule="midpoint")
    save_shells(stack, tmp_path)
    back = import_shells(tmp_path / "shells.vtm", ReadField(array="refractivity"))
    for a, b in zip(stack.shells, back.shells, strict=True):
        assert_array_equal(a.vertices, b.vertices)
        assert_array_equal(a.faces, b.faces)
        assert_allclose((a.ext, a.int_), (b.ext, b.int_), rtol=1e-12)


@pytest.mark.parametrize("quantity", ["temperature", "index"])
def test_gradient_of_the_file_gives_normals(tmp_path, quantity):
    # The gradient of T points to the centre, that of n away from it.
    inward = quantity == "temperature"
    surface = merged(spheres("T [K]" if inward else "n", KELVIN if inward else LEVELS))
    surface.point_data["grad"] = surface.points * (-2.0 if inward else 1e-5)
    surface.save(tmp_path / "s.vtp")
    assert not import_shells(tmp_path / "s.vtp").has_normals
    stack = import_shells(tmp_path / "s.vtp", gradient="grad")
    check(stack)
    for shell in stack.shells:
        radial = shell.vertices / np.linalg.norm(shell.vertices, axis=1)[:, None]
        assert_allclose(shell.normals, radial, atol=1e-6)


def test_gradient_turns_as_a_gradient_does(tmp_path):
    # Stretched twofold along x the normals of an ellipsoid are (x / 4, y, z), not (x, y, z) nor
    # the stretched (2 x, y, z).
    surface = merged(spheres("n", LEVELS))
    surface.point_data["Gradient_n"] = np.asarray(surface.points)
    surface.save(tmp_path / "s.vtp")
    stack = import_shells(
        tmp_path / "s.vtp", ReadField(transform=np.diag([2.0, 1, 1, 1])), gradient="Gradient_n"
    )
    expected = stack.shells[0].vertices * [0.25, 1, 1]
    expected = expected / np.linalg.norm(expected, axis=1)[:, None]
    assert_allclose(stack.shells[0].normals, expected, atol=1e-6)


def test_single_surface_is_turned_away_from_its_centre(tmp_path):
    blocks = spheres()
    blocks[0].save(tmp_path / "s.vtp")
    (shell,) = import_shells(tmp_path / "s.vtp").shells
    assert signed_volume(shell.vertices, shell.faces) > 0
    # One step of twice the distance from ambient to the surface.
    assert_allclose(shell.ext - shell.int_, 2 * (AMBIENT - LEVELS[1]), rtol=1e-5)


def test_triangle_soup_is_welded_and_small_components_are_dropped(tmp_path):
    blocks = spheres(cells=True)
    small = pv.Icosphere(radius=0.2, center=(50, 0, 0), nsub=1)
    small.cell_data["T [K]"] = np.full(small.n_cells, KELVIN[0])
    surface = merged(pv.MultiBlock([*blocks, small]))
    corners = np.asarray(surface.points)[np.asarray(surface.regular_faces)].reshape(-1, 3)
    soup = pv.PolyData.from_regular_faces(corners, np.arange(len(corners)).reshape(-1, 3))
    soup.cell_data["T [K]"] = surface.cell_data["T [K]"]
    soup.save(tmp_path / "s.vtp")
    stack = import_shells(tmp_path / "s.vtp")
    check(stack)
    assert stack.small_components == (SmallComponents(1, 1, small.n_cells),)


def test_rounded_values_are_one_surface(tmp_path):
    surface = merged(spheres())
    noise = np.random.default_rng(5).uniform(-1e-3, 1e-3, surface.n_points)
    surface.point_data["T [K]"] = (surface.point_data["T [K]"] + noise).astype(np.float32)
    surface.save(tmp_path / "s.vtp")
    check(import_shells(tmp_path / "s.vtp"))


def wrong_meshes() -> dict[str, pv.DataObject]:
    """Meshes that are no surfaces of one value each, by what is wrong with them."""
    surface, cells = merged(spheres()), merged(spheres(cells=True))
    rising, two = surface.copy(), surface.copy()
    rising.point_data["T [K]"] = 300.0 + np.asarray(surface.points)[:, 2]
    two.point_data["b"] = two.point_data["a"] = two.point_data.pop("T [K]")
    gaps, rising_cells = cells.copy(), cells.copy()
    gaps.cell_data["T [K]"][3] = np.nan
    rising_cells.cell_data["T [K]"] = np.linspace(300.0, 900.0, cells.n_cells)
    volume = sphere_field(4).grid
    volume["T"] = np.full(volume.n_points, 300.0)
    blocks = spheres()
    del blocks[1].point_data["T [K]"]
    return {
        "no triangles; volume data": volume,
        "no array named as": two,
        "change along the triangles": rising,
        r"of 'T \[K\]' in .* change along the triangles": rising_cells,
        "not finite": gaps,
        r"The array 'T \[K\]' is missing": blocks,
        "ambient": merged(spheres(values=KELVIN - 60)),
    }


def test_wrong_meshes_are_refused(tmp_path):
    for message, mesh in wrong_meshes().items():
        kind = {pv.UnstructuredGrid: "vtu", pv.MultiBlock: "vtm"}.get(type(mesh), "vtp")
        mesh.save(tmp_path / f"s.{kind}")
        with pytest.raises(InputError, match=message):
            import_shells(tmp_path / f"s.{kind}")


@pytest.mark.parametrize(
    ("name", "save", "message"),
    [
        ("s.vtp", lambda path: None, "There is no file"),
        ("s.stl", lambda path: pv.Sphere().save(path), "is not a file of surfaces"),
        ("s.vtp", lambda path: path.write_text("<VTKFile"), "no triangles|cannot be read"),
    ],
)
def test_wrong_files_are_refused(tmp_path, name, save, message):
    path = tmp_path / name
    save(path)
    with pytest.raises(InputError, match=message):
        import_shells(path)


def test_wrong_options_are_refused(tmp_path):
    path = tmp_path / "s.vtp"
    merged(spheres()).save(path)
    with pytest.raises(InputError, match="no gradient 'g'"):
        import_shells(path, gradient="g")
    with pytest.raises(InputError, match="no array 'U'"):
        import_shells(path, ReadField(array="U"))
    with pytest.raises(InputError, match="length unit or allow"):
        import_shells(path, min_size_mm=100.0)


def test_ambient_air_sets_the_outermost_layer(tmp_path):
    path = tmp_path / "s.vtp"
    merged(spheres()).save(path)
    warm = import_shells(path, air=evolve(Air(), temperature_k=300.0))
    assert warm.shells[0].ext == Air(temperature_k=300.0).ambient_refractivity
