"""A study may be interrupted or killed: the same call goes on and gives the same file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from iriftrace.core.errors import InputError
from iriftrace.studies.cases import read_study, run_cases

REQUEST = {"study": "squares", "count": 5}


def dataset_of(entries: list[dict[str, Any]]) -> xr.Dataset:
    return xr.Dataset({"square": (("n",), np.array([entry["square"] for entry in entries]))})


def square(number: int) -> dict[str, Any]:
    return {"square": number * number}


def test_an_interrupted_study_goes_on_where_it_stopped(tmp_path: Path) -> None:
    measured: list[int] = []
    interruptions = iter([True])
    progress: list[tuple[int, int]] = []

    def measure(number: int) -> dict[str, Any]:
        if number == 3 and next(interruptions, False):
            raise KeyboardInterrupt
        measured.append(number)
        return square(number)

    out = tmp_path / "squares.nc"
    with pytest.raises(KeyboardInterrupt):
        run_cases(out, REQUEST, 5, measure, dataset_of)
    assert not out.exists()
    found = run_cases(
        out, REQUEST, 5, measure, dataset_of, lambda done, of: progress.append((done, of))
    )
    assert measured == [0, 1, 2, 3, 4]
    assert progress == [(3, 5), (4, 5), (5, 5)]
    np.testing.assert_array_equal(found["square"], [0, 1, 4, 9, 16])
    assert [path.name for path in tmp_path.iterdir()] == ["squares.nc"]


def test_a_finished_study_is_read_and_not_measured_again(tmp_path: Path) -> None:
    out = tmp_path / "squares.nc"
    run_cases(out, REQUEST, 5, square, dataset_of)
    before = out.read_bytes()

    def never(number: int) -> dict[str, Any]:
        raise AssertionError(number)

    again = run_cases(out, REQUEST, 5, never, dataset_of)
    np.testing.assert_array_equal(again["square"], [0, 1, 4, 9, 16])
    assert out.read_bytes() == before


def test_another_study_is_never_replaced(tmp_path: Path) -> None:
    out = tmp_path / "squares.nc"
    run_cases(out, REQUEST, 5, square, dataset_of)
    with pytest.raises(InputError, match="study of other files or options"):
        run_cases(out, {**REQUEST, "count": 6}, 6, square, dataset_of)
    (tmp_path / "text.nc").write_text("no netCDF")
    with pytest.raises(InputError, match="is no study"):
        run_cases(tmp_path / "text.nc", REQUEST, 5, square, dataset_of)


def test_the_journal_of_another_study_is_refused(tmp_path: Path) -> None:
    def stop(number: int) -> dict[str, Any]:
        if number:
            raise KeyboardInterrupt
        return square(number)

    out = tmp_path / "squares.nc"
    with pytest.raises(KeyboardInterrupt):
        run_cases(out, REQUEST, 5, stop, dataset_of)
    with pytest.raises(InputError, match="belongs to a study of other"):
        run_cases(out, {**REQUEST, "count": 6}, 6, square, dataset_of)


def test_reading_says_what_is_wrong(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="There is no study"):
        read_study(tmp_path / "gone.nc")
    other = tmp_path / "other.nc"
    xr.Dataset({"a": 1}).to_netcdf(other, engine="h5netcdf")
    with pytest.raises(InputError, match="schema"):
        read_study(other)
