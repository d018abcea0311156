"""OpenFOAM cases, whole and decomposed: temperatures at walls to the last digit, linear fields."""

import gzip
import hashlib
import re
import shutil
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_allclose

from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.io.field import read_field, read_volume
from iriftrace.io.members import member_at, members
from iriftrace.io.reading import ReadField
from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.air.thermophysics import heat_content
from iriftrace.medium.gradient import cell_corners
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.volume import linear_volume
from validation.field_files.openfoam import Form, write_case
from validation.field_files.openfoam_mesh import Patch
from validation.inputs.hot_block import HALF, OUTER, WALL, air_in_metres, half, patches

COOL = Air(temperature_k=321.5)
"""Ambient of the linear field, so that nothing is said about its coolest air."""
SINGLE = 1e-7
"""VTK reads values in single precision."""


def linear(grid: pv.UnstructuredGrid) -> np.ndarray:
    return 440.0 + 8e3 * np.asarray(grid.cell_centers().points)[:, 0]


def on_wall(points: np.ndarray) -> np.ndarray:
    """Mask of the points, mm, on the block."""
    return (np.abs(points) < 1.001 * HALF).all(axis=1)


def quarters(grid: pv.UnstructuredGrid) -> np.ndarray:
    centres = np.asarray(grid.cell_centers().points)
    return (centres[:, 0] > 0) + 2 * (centres[:, 1] > 0)


@pytest.fixture
def case(tmp_path: Path) -> Path:
    """Hot block in air whose temperature rises along x, at two times after the initial one."""
    grid = air_in_metres()
    fields = {
        time: {"T": linear(grid) + offset, "p": np.full(grid.n_cells, 1e5)}
        for time, offset in (("0", 0.0), ("1", 1.0), ("2.5", 2.5))
    }
    return write_case(tmp_path / "case", grid, fields, patches())


def assert_linear(field: IndexField, offset: float) -> None:
    """Wall temperature on the wall, the linear field elsewhere within the domain."""
    points = np.asarray(field.grid.points)
    wall = on_wall(points)
    assert wall.sum() == 26
    assert_allclose(field.temperature_k[wall], WALL, rtol=SINGLE)
    inner = ~wall & (np.abs(points) < 0.99 * OUTER).all(axis=1)
    assert_allclose(
        field.temperature_k[inner], 440.0 + offset + 8.0 * points[inner, 0], rtol=4 * SINGLE
    )


def test_the_latest_time_is_read_in_millimetres(case: Path) -> None:
    with pytest.warns(IriftraceWarning, match="2 states; the last one, t = 2.5, is used"):
        field = read_field(case, air=COOL)
    assert field.grid.volume == pytest.approx((2 * OUTER) ** 3 - (2 * HALF) ** 3)
    assert set(field.grid.celltypes) == {pv.CellType.HEXAHEDRON}
    assert_linear(field, 2.5)
    assert field.source.length_unit == "m"
    assert field.source.origin == "OpenFOAM buoyantPimpleFoam, t = 2.5 s"


def test_members_are_the_times_without_the_initial_one(case: Path) -> None:
    assert [(m.label, m.time, m.index) for m in members(case)] == [
        ("t = 1", 1.0, 0),
        ("t = 2.5", 2.5, 1),
    ]
    for when, index in (("first", 0), ("latest", 1), ("2.5", 1), ("2.50", 1), ("t=1", 0)):
        assert member_at(case, when).index == index
    assert_linear(read_field(case, member=0, air=COOL), 1.0)
    with pytest.raises(InputError, match="no state '2': it has t = 1; t ="):
        member_at(case, "2")
    with pytest.raises(InputError, match=r"has 2 states.*no state 2"):
        read_field(case, member=2)


@pytest.mark.parametrize("name", ["case.foam", "case.OpenFOAM", "system/controlDict"])
def test_a_file_in_the_case_names_it(case: Path, name: str) -> None:
    (case / name).touch()
    assert_linear(read_field(case / name, member=0, air=COOL), 1.0)


def test_the_checksum_is_that_of_the_files_read(case: Path) -> None:
    before = read_field(case, member=0, air=COOL).source.sha256
    files = [*(case / "constant/polyMesh").iterdir(), *(case / "1").iterdir()]
    lines = [
        f"{hashlib.sha256(f.read_bytes()).hexdigest()}  {f.relative_to(case).as_posix()}\n"
        for f in sorted(files)
    ]
    assert before == hashlib.sha256("".join(lines).encode()).hexdigest()
    assert read_field(case, member=1, air=COOL).source.sha256 != before


def test_processors_that_are_missing_or_did_not_finish(tmp_path: Path) -> None:
    grid = air_in_metres()
    fields = {time: {"T": linear(grid) + float(time)} for time in ("1", "2")}
    folder = write_case(tmp_path, grid, fields, patches(), processors=quarters(grid))
    shutil.rmtree(folder / "processor2/2")
    assert [member.label for member in members(folder)] == ["t = 1"]
    assert_linear(read_field(folder, air=COOL), 1.0)
    with pytest.raises(InputError, match=r"only a part .* borders on processor1, processor2; give"):
        read_field(folder / "processor0")
    shutil.rmtree(folder / "processor3")
    with pytest.raises(InputError, match=r"only a part .* borders on processor3; give"):
        read_field(folder)


def test_initial_values_are_warned_of(case: Path) -> None:
    for name in ("1", "2.5"):
        shutil.rmtree(case / name)
    with pytest.warns(IriftraceWarning, match=r"only time of the case .* is 0.*run the solver"):
        read_field(case, air=COOL)


@pytest.mark.parametrize(
    ("names", "array", "words"),
    [
        (("T", "TMean"), "T", r"'T', which is used, of one moment.*use 'TMean'"),
        (("T", "TMean", "rhoMean"), "T", "use 'rhoMean'"),
        (("TMean", "TPrime2Mean"), "TMean", r"'TMean' .* is an average over time.*density"),
        (("TMean", "rhoMean"), "rhoMean", ""),
    ],
)
def test_averages_of_openfoam(
    tmp_path: Path, names: tuple[str, ...], array: str, words: str
) -> None:
    grid = air_in_metres()
    kelvin = linear(grid)
    # TPrime2Mean, in K^2, is no temperature.
    values = {"rhoMean": 353.0 / kelvin, "TPrime2Mean": np.ones(grid.n_cells)}
    fields = {"1": {name: values.get(name, kelvin) for name in names}}
    case = write_case(tmp_path, grid, fields, patches())
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        field = read_field(case, air=COOL)
    assert field.source.array == array
    assert field.source.time == ("mean" if array.endswith("Mean") else "")
    said = [str(one.message) for one in caught if "coolest air" not in str(one.message)]
    assert [bool(re.search(words, text)) for text in said] == [True] * bool(words)


@pytest.mark.parametrize("form", ["ascii", "gz", "binary"])
def test_a_decomposed_case_is_the_same_field(tmp_path: Path, case: Path, form: Form) -> None:
    grid = air_in_metres()
    apart = write_case(
        tmp_path / "apart",
        grid,
        {"1": {"T": linear(grid) + 1.0}},
        patches(),
        processors=quarters(grid),
        form=form,
    )
    whole, field = read_field(case, member=0, air=COOL), read_field(apart, air=COOL)
    assert (field.grid.n_points, field.grid.n_cells) == (whole.grid.n_points, whole.grid.n_cells)
    assert_linear(field, 1.0)
    # Joined at the seams: the only boundaries are the cube's and the block's.
    assert field.grid.extract_surface(algorithm="geometry").area == pytest.approx(
        6 * (2 * OUTER) ** 2 + 6 * (2 * HALF) ** 2
    )
    order = [np.lexsort(np.round(np.asarray(f.grid.points), 6).T) for f in (whole, field)]
    assert_allclose(field.temperature_k[order[1]], whole.temperature_k[order[0]], rtol=1e-9)


def test_processors_that_went_on_after_reconstruction_are_reported(tmp_path: Path) -> None:
    grid = air_in_metres()
    folder = write_case(tmp_path, grid, {"1": {"T": linear(grid) + 1.0}}, patches())
    later = {"2": {"T": linear(grid) + 2.0}}
    write_case(folder, grid, later, patches(), processors=quarters(grid))
    with pytest.warns(IriftraceWarning, match=r"up to t = 1.*processors continue to t = 2"):
        assert_linear(read_field(folder, air=COOL), 1.0)
    shutil.rmtree(folder / "1")
    assert_linear(read_field(folder, air=COOL), 2.0)


def test_polyhedra_keep_their_volume_and_value(tmp_path: Path) -> None:
    """Pairs of neighbouring cells as polyhedra with ten faces."""
    grid = air_in_metres()
    pairs = np.arange(grid.n_cells) // 2
    values = np.bincount(pairs, linear(grid)) / 2
    folder = write_case(tmp_path, grid, {"1": {"T": values}}, patches(), groups=pairs)
    field = read_field(folder, air=Air(temperature_k=values.min()))
    assert set(field.grid.celltypes) == {pv.CellType.PYRAMID}
    assert field.grid.volume == pytest.approx((2 * OUTER) ** 3 - (2 * HALF) ** 3)
    # The centroids that were added carry their cells' values, which the linear field has there.
    added = np.asarray(field.grid.points)[-len(values) :]
    assert_allclose(field.temperature_k[-len(values) :], values, rtol=1e-6)
    assert_allclose(440.0 + 8.0 * added[:, 0], values, rtol=1e-6)


def test_linear_fields_stay_linear_where_cells_double_in_size(tmp_path: Path) -> None:
    axis = np.array((-8.0, -4.0, -2.0, -1.0, 0.0, 1.0, 3.0, 7.0)) / 1e3
    grid = pv.StructuredGrid(*np.meshgrid(axis, axis, axis, indexing="ij"))
    grid = grid.cast_to_unstructured_grid()
    slope = np.array((8e3, -5e3, 3e3))
    values = 440.0 + np.asarray(grid.cell_centers().points) @ slope
    folder = write_case(tmp_path, grid, {"1": {"T": values}}, patches()[1:])
    field = read_field(folder, air=Air(temperature_k=values.min()))
    points = np.asarray(field.grid.points)
    inner = ((points > -7.9) & (points < 6.9)).all(axis=1)
    assert inner.sum() == 6**3
    expected = 440.0 + points[inner] / 1e3 @ slope
    assert_allclose(field.temperature_k[inner], expected, rtol=4 * SINGLE)


def test_linear_fields_stay_linear_in_pyramids(tmp_path: Path) -> None:
    """OpenFOAM's values are those at centroids, a quarter of a pyramid's height above its base."""
    axis = np.array((-8.0, -4.0, -2.0, -1.0, 1.0, 3.0, 7.0)) / 1e3
    cubes = pv.RectilinearGrid(axis, axis, axis).cast_to_unstructured_grid()
    corners = cell_corners(linear_volume(cubes))[pv.CellType.HEXAHEDRON][1]
    bases = ((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (2, 6, 7, 3), (0, 3, 7, 4), (1, 5, 6, 2))
    apex = cubes.n_points + np.arange(cubes.n_cells)
    cells = np.concatenate([np.column_stack((corners[:, base], apex)) for base in bases])
    points = np.concatenate((cubes.points, cubes.cell_centers().points)).astype(np.float64)
    grid = pv.UnstructuredGrid({pv.CellType.PYRAMID: cells}, points)
    slope = np.array((8e3, -5e3, 3e3))
    centroids = 0.75 * points[cells[:, :4]].mean(axis=1) + 0.25 * points[cells[:, 4]]
    values = 440.0 + centroids @ slope
    folder = write_case(tmp_path, grid, {"1": {"T": values}}, patches()[1:])
    air = read_volume(folder).data
    assert set(air.celltypes) == {pv.CellType.PYRAMID}
    points = np.asarray(air.points)
    inner = ((points > -7.9e-3) & (points < 6.9e-3)).all(axis=1)
    assert inner.sum() == 5**3 + 6**3
    assert_allclose(air.point_data["T"][inner], 440.0 + points[inner] @ slope, rtol=4 * SINGLE)


def test_a_wall_keeps_its_temperature_where_it_meets_other_patches(tmp_path: Path) -> None:
    """Half the block behind a symmetry plane: its edge is on the wall and on the plane."""
    grid = half(air_in_metres())
    mirror = Patch("mirror", "symmetryPlane", lambda c: np.abs(c[:, 0]) < 1e-9, None)
    block, cold = patches(outside=293.15)
    fields = {"1": {"T": np.full(grid.n_cells, 400.0)}}
    folder = write_case(tmp_path, grid, fields, [block, mirror, cold])
    field = read_field(folder)
    points = np.asarray(field.grid.points)
    wall = on_wall(points)
    assert_allclose(field.temperature_k[wall], WALL, rtol=SINGLE)
    outside = (np.abs(points) > 0.99 * OUTER).any(axis=1)
    assert_allclose(field.temperature_k[outside], 293.15, rtol=1e-7)
    assert_allclose(field.temperature_k[~wall & ~outside], 400.0, rtol=1e-12)


def test_velocities_are_read_at_the_points_too(tmp_path: Path) -> None:
    """Still at the wall, linear in the air; the flux of heat is made of the values in the cells."""
    grid = air_in_metres()
    folder = write_case(tmp_path / "case", grid, {"1": {"T": linear(grid)}}, patches())
    centres = np.asarray(grid.cell_centers().points, dtype=np.float64)
    velocity = np.stack((10.0 * centres[:, 2], np.full(len(centres), 0.25), centres[:, 0]), axis=1)
    rows = "\n".join(f"({x:.17g} {y:.17g} {z:.17g})" for x, y, z in velocity)
    scalar = (folder / "1/T").read_text()
    header = scalar[: scalar.index("dimensions")].replace("volScalarField", "volVectorField")
    (folder / "1/U").write_text(
        header.replace("object T", "object U")
        + f"dimensions [0 1 -1 0 0 0 0];\ninternalField nonuniform List<vector>\n{len(velocity)}"
        f"\n(\n{rows}\n);\nboundaryField\n{{\n    block {{ type noSlip; }}\n"
        "    outside { type zeroGradient; }\n}\n"
    )
    field = read_field(folder, air=COOL, flow=True)
    assert field.source.array == "T"
    points = np.asarray(field.grid.points)
    wall = on_wall(points)
    inner = ~wall & (np.abs(points) < 0.99 * OUTER).all(axis=1)
    assert field.flow.velocity[wall] == pytest.approx(0.0)
    x, _, z = points[inner].T / 1e3
    expected = np.stack((10.0 * z, np.full(len(x), 0.25), x), axis=1)
    assert field.flow.velocity[inner] == pytest.approx(expected, abs=1e-7)
    content = heat_content(field.temperature_k[inner], COOL.temperature_k, COOL.pressure_pa)
    # Of values in cells 6 mm apart: mean of the products, not product of the means.
    assert field.flow.enthalpy_flux[inner] == pytest.approx(
        content[:, None] * expected, abs=0.03 * content.max() * 0.25
    )
    assert read_field(folder, air=COOL).flow is None
    assert list(read_volume(folder).data.point_data) == ["T"], "only where they are asked for"


def remove(name: str) -> Callable[[Path], None]:
    def change(case: Path) -> None:
        target = case / name
        shutil.rmtree(target) if target.is_dir() else target.unlink()

    return change


def cut(name: str) -> Callable[[Path], None]:
    def change(case: Path) -> None:
        text = (case / name).read_bytes()
        (case / name).write_bytes(text[: len(text) // 2])

    return change


def regions(case: Path) -> None:
    (case / "constant/air").mkdir()
    (case / "constant/polyMesh").rename(case / "constant/air/polyMesh")


def collated(case: Path) -> None:
    for name in ("constant", "1", "2.5", "0"):
        shutil.rmtree(case / name)
    (case / "processors4").mkdir()


def collated_but_for_the_initial_values(case: Path) -> None:
    (case / "2.5").rename(case / "processors2_0-1")
    (case / "1").rename(case / "processors2_0-1/1")


def no_times(case: Path) -> None:
    for name in ("0", "1", "2.5"):
        shutil.rmtree(case / name)


def wrong_gz(case: Path) -> None:
    (case / "2.5/T").unlink()
    (case / "2.5/T.gz").write_bytes(gzip.compress(b"FoamFile")[:-6])


def edit(pattern: str, new: str) -> Callable[[Path], None]:
    def change(case: Path) -> None:
        (case / "2.5/T").write_text(re.sub(pattern, new, (case / "2.5/T").read_text()))

    return change


VARIABLE = edit(r"(value\s+)(non)?uniform[^;]*", r"\1uniform $hot")
ENTHALPY = edit(r"\[0 0 0 1 0 0 0\]", "[0 2 -2 0 0 0 0]")


def twice(case: Path) -> None:
    (case / "2.5/T.gz").write_bytes(gzip.compress((case / "2.5/T").read_bytes()))


DAMAGE = {
    "a variable": (VARIABLE, r"2\.5/T cannot be read .it has variables or directives"),
    "an enthalpy": (ENTHALPY, r"states the dimensions \[0 2 -2 0 0 0 0\], which are not those"),
    "packed and plain": (twice, r"both T and T\.gz"),
    "no mesh": (remove("constant/polyMesh"), "has no mesh"),
    "regions": (regions, r"the regions air, of which none are fluid.*such as .*constant/air\."),
    "collated": (collated, "collated format.*reconstructPar"),
    "collated but for t = 0": (
        collated_but_for_the_initial_values,
        "in processors2_0-1, in OpenFOAM's collated format.*reconstructPar",
    ),
    "no times": (no_times, "no time folder with results"),
    "no temperature": (remove("2.5/T"), "no array named as a temperature.*are p"),
    "cut temperature": (cut("2.5/T"), r"2\.5/T cannot be read.*choose another time"),
    "empty temperature": (lambda case: (case / "2.5/T").write_text(""), r"2\.5/T cannot be read"),
    "damaged archive": (wrong_gz, r"2\.5/T cannot be read"),
    "cut points": (cut("constant/polyMesh/points"), "cannot be read"),
    "cut faces": (cut("constant/polyMesh/faces"), "cannot be read"),
    "no owner": (remove("constant/polyMesh/owner"), "cannot be read"),
    "no boundary": (remove("constant/polyMesh/boundary"), "cannot be read"),
}


@pytest.mark.parametrize(("change", "words"), DAMAGE.values(), ids=DAMAGE.keys())
def test_damaged_cases(
    case: Path, capfd: pytest.CaptureFixture[str], change: Callable[[Path], None], words: str
) -> None:
    change(case)
    last = None if not (case / "2.5").is_dir() else 1
    with pytest.raises(InputError, match=words):
        read_field(case, member=last)
    assert capfd.readouterr() == ("", "")


def test_a_folder_that_is_no_case(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is not an OpenFOAM case"):
        read_field(tmp_path)


def test_another_unit_of_length_is_refused(case: Path) -> None:
    with pytest.raises(InputError, match=r"read in mm; .* scale them by 0\.001 if") as error:
        read_field(case, ReadField(length_unit="mm"), member=0)
    assert (error.value.code, error.value.argument) == ("units.contradict", "field_length_unit")
