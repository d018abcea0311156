"""Case after case of a study, kept in a journal, so that it may be killed at any time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from iriftrace.core.errors import InputError
from iriftrace.core.files import whole_file
from iriftrace.sweep.journal import Journal, Piece, Work
from iriftrace.sweep.pose import fingerprint

if TYPE_CHECKING:
    import xarray as xr


SCHEMA = "iriftrace.study/1"

Entry = dict[str, Any]


def run_cases(
    path: Path,
    request: Mapping[str, Any],
    count: int,
    measure: Callable[[int], Entry],
    dataset_of: Callable[[list[Entry]], xr.Dataset],
    progress: Callable[[int, int], None] | None = None,
) -> xr.Dataset:
    """Measure every case and write the study's netCDF file.

    Finished cases go into a journal (:mod:`iriftrace.sweep.journal`): the same call goes on where
    an earlier one was interrupted or killed.

    Parameters
    ----------
    path : Path
        The netCDF file. If it is there and holds the same study, it is read and nothing is done.
    request : mapping
        Plain JSON values that tell this study from another.
    count : int
        Number of cases.
    measure : callable
        From a case's number to plain JSON values.
    dataset_of : callable
        From all cases' values, in order, to the result.
    progress : callable, optional
        Called with the number of finished cases and of all cases.

    Returns
    -------
    xarray.Dataset

    Raises
    ------
    InputError
        If the file cannot be written, or belongs to another study.
    """
    wanted = fingerprint(version("iriftrace"), dict(request))

    def left(journal: Journal) -> Iterator[Piece]:
        for number in range(count):
            if number not in journal:
                yield Piece(number, measure(number))

    def write(journal: Journal) -> None:
        dataset = dataset_of([journal.entry(number) for number in range(count)])
        dataset.attrs |= {"schema": SCHEMA, "request": wanted}
        with whole_file(path) as temporary:
            dataset.to_netcdf(temporary, engine="h5netcdf")

    work = Work("study", "files or options", path, wanted, count)
    return work.run(left, write, read_study, progress)


def read_study(path: str | Path) -> xr.Dataset:
    """Read a study that :func:`run_cases` wrote.

    Raises
    ------
    InputError
        If the file is missing, no netCDF, or of another program.
    """
    import xarray as xr

    if not Path(path).is_file():
        raise InputError(f"There is no study {path}; `iriftrace study` writes one.")
    try:
        with xr.open_dataset(path, engine="h5netcdf") as file:
            dataset: xr.Dataset = file.load()
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"{path} is no netCDF file ({error}); give a study.") from error
    if dataset.attrs.get("schema") != SCHEMA:
        raise InputError(
            f"{path} has schema {dataset.attrs.get('schema')!r} instead of {SCHEMA!r}, so it is no "
            "study of this version of iriftrace; run the study again."
        )
    return dataset


def is_study(path: str | Path) -> bool:
    """Whether a file is a study's and no other netCDF file."""
    import xarray as xr

    try:
        with xr.open_dataset(path, engine="h5netcdf") as file:
            return str(file.attrs.get("schema", "")).startswith(SCHEMA.partition("/")[0] + "/")
    except (OSError, ValueError, KeyError):
        return False
