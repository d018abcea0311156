"""Thermal growth of a part: its factor, and that it travels with the file."""

from pathlib import Path

import numpy as np
import pytest

from iriftrace.core.errors import InputError
from iriftrace.io.part_files import read_part, save_part
from iriftrace.io.reading import ReadPart
from iriftrace.part.growth import Growth
from iriftrace.scenes import folder_of

STEEL = Growth(14e-6, 293.15, 1323.15)


def test_lengths_grow_by_the_expansion() -> None:
    assert STEEL.factor == pytest.approx(1.01442)


def test_it_is_read_back_from_the_file(tmp_path: Path) -> None:
    """An expanded part is not expanded again; an STL, which cannot state it, is refused."""
    file = folder_of("cylinder") / "part.ply"
    part = read_part(file, ReadPart(expansion=14e-6, hot_temperature=1323.15))
    save_part(part, tmp_path / "hot.ply")
    again = read_part(tmp_path / "hot.ply")
    assert again.growth == part.growth == STEEL
    np.testing.assert_allclose(again.bounds, part.bounds, rtol=1e-6)
    with pytest.raises(InputError, match="expanded to 1050 degC already"):
        read_part(tmp_path / "hot.ply", ReadPart(expansion=14e-6, hot_temperature=1323.15))
    with pytest.raises(InputError, match=r"hot.stl cannot state .* name it .*hot.ply") as refused:
        save_part(part, tmp_path / "hot.stl")
    assert (refused.value.code, refused.value.argument) == ("part.growth_not_written", "output")
    assert not (tmp_path / "hot.stl").exists()
    text = (tmp_path / "hot.ply").read_bytes()
    (tmp_path / "odd.ply").write_bytes(text.replace(b"1.4e-05 /K", b"unknown /K"))
    assert read_part(tmp_path / "odd.ply").growth is None


def test_temperatures_without_their_unit_are_noticed() -> None:
    """A drawing of 20 K instead of 20 degC is 0.4 % too small."""
    for reference_k, hot_k in ((20.0, 1323.15), (293.15, 150.0)):
        with pytest.raises(InputError, match='temperatures with their unit, "20 degC"'):
            Growth(14e-6, reference_k, hot_k)
