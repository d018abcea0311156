"""Classes that describe a field, its shells and a part mean the same in text as in numbers."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from iriftrace.core.errors import InputError
from iriftrace.io.field import read_field
from iriftrace.io.part_files import read_part
from iriftrace.io.reading import ReadField, ReadPart
from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.shells.options import ShellOptions
from iriftrace.tracing.camera_options import CameraOptions
from validation.inputs import hot_block


@pytest.mark.parametrize("hot", [1293.15, "1293.15 K", "1020 degC", ["1020 degC"]])
@pytest.mark.parametrize("expansion", [1e-5, "10 um/m/K"])
@pytest.mark.parametrize("transform", ["translate 0 0 5", np.eye(4)])
def test_a_part_expands_by_its_temperature(
    tmp_path: Path, hot: object, expansion: object, transform: object
) -> None:
    """A cube of 20 mm, 1000 K hotter than drawn: 1 % larger, in whatever form it is said."""
    trimesh.creation.box((2.0, 2.0, 2.0)).export(tmp_path / "box.stl")
    reading = ReadPart("cm", transform, expansion, hot_temperature=hot)
    part = read_part(tmp_path / "box.stl", reading)
    np.testing.assert_allclose(np.ptp(part.bounds, axis=0), 20.2, rtol=1e-7)
    lifted = 5.0 if isinstance(transform, str) else 0.0
    np.testing.assert_allclose(part.centre, (0.0, 0.0, lifted), atol=1e-6)


def test_a_field_is_moved_by_text_and_by_a_matrix(tmp_path: Path) -> None:
    file, _ = hot_block.save(tmp_path)
    matrix = np.eye(4)
    matrix[:3, 3] = 1.0, 2.0, 3.0
    places = [
        read_field(file, ReadField(transform=by)).grid.points for by in (matrix, "translate 1 2 3")
    ]
    np.testing.assert_array_equal(*places)
    moved = places[0] - read_field(file).grid.points
    np.testing.assert_allclose(moved, np.tile(matrix[:3, 3], (len(moved), 1)), atol=1e-4)


def test_isosurfaces_are_no_volume(tmp_path: Path) -> None:
    file, _ = hot_block.save(tmp_path)
    with pytest.raises(InputError) as refused:
        read_field(file, ReadField(isosurfaces=True))
    assert (refused.value.code, refused.value.argument) == ("field.isosurfaces", "isosurfaces")


def test_the_range_of_the_index_is_also_one_of_temperatures() -> None:
    """n - 1 of air is proportional to 1/T."""
    air = Air()
    ambient, hot = ShellOptions(index_range="293.15 K:879.45 K").ends(air)
    assert ambient == pytest.approx(air.ambient_refractivity, rel=1e-12)
    assert hot == pytest.approx(ambient / 3.0, rel=1e-12)
    assert ShellOptions(index_range="2.7e-4:1e-4").ends(air) == (2.7e-4, 1e-4)


@pytest.mark.parametrize("text", ["2e-4", "1.00027:2e-4", "20:2e-4"])
def test_ranges_that_are_not_of_air_are_refused(text: str) -> None:
    with pytest.raises(InputError) as refused:
        ShellOptions(index_range=text).ends(Air())
    assert (refused.value.code, refused.value.argument) == ("shells.index_range", "index_range")


def test_a_camera_is_described_by_texts_and_by_numbers() -> None:
    texts = CameraOptions("1 cm", "6.7 mm,5.6 mm", "2448,2048", focus="50:250", origin="1,2,3")
    numbers = CameraOptions(10, (6.7, 5.6), (2448, 2048), focus=(50, 250), origin=(1, 2, 3))
    assert texts == numbers
