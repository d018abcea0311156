"""Thermal growth of a part: its arithmetic, and that it travels with the file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from iriftrace.core.errors import InputError
from iriftrace.part.growth import Growth
from iriftrace.part.part import read_part, save_part
from iriftrace.scenes import folder_of

STEEL = Growth(14e-6, 293.15, 1323.15)


def test_a_size_at_another_temperature() -> None:
    """60 mm at 20 degC are 60.8652 mm at 1050 degC, and its uncertainty is that of 20,000 draws."""
    hot = 60.0 * 1.01442
    assert STEEL.factor == pytest.approx(1.01442)
    assert STEEL.reference_size(hot) == pytest.approx(60.0)
    rng = np.random.default_rng(1)
    expansion = 14e-6 * (1 + 0.02 * rng.normal(size=20000))
    sizes = hot / (1 + expansion * (1030.0 + 10.0 * rng.normal(size=20000)))
    assert STEEL.u_reference_size(hot, 0.02, 10.0) == pytest.approx(sizes.std(), rel=0.02)


def test_it_is_read_back_from_the_file(tmp_path: Path) -> None:
    """An expanded part is not expanded again; STL states none."""
    file = folder_of("cylinder") / "part.ply"
    part = read_part(file, expansion=14e-6, hot_temperature_k=1323.15)
    save_part(part, tmp_path / "hot.ply")
    again = read_part(tmp_path / "hot.ply")
    assert again.growth == part.growth == STEEL
    np.testing.assert_allclose(again.bounds, part.bounds, rtol=1e-6)
    with pytest.raises(InputError, match="expanded to 1050 degC already"):
        read_part(tmp_path / "hot.ply", expansion=14e-6, hot_temperature_k=1323.15)
    save_part(part, tmp_path / "hot.stl")
    assert read_part(tmp_path / "hot.stl").growth is None
    text = (tmp_path / "hot.ply").read_bytes()
    (tmp_path / "odd.ply").write_bytes(text.replace(b"1.4e-05 /K", b"unknown /K"))
    assert read_part(tmp_path / "odd.ply").growth is None
