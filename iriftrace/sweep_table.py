"""A sweep as a plain table for other programs: CSV or Parquet."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from iriftrace.errors import InputError, SetupError
from iriftrace.sweep_store import WHOLE_PART
from iriftrace.whole_file import whole_file

if TYPE_CHECKING:
    import xarray as xr

SUFFIXES = (".csv", ".parquet")


def check_table(path: Path) -> None:
    """Refuse before the work a table that could not be written after it.

    Raises
    ------
    InputError
        If its name ends in something else than ``.csv`` or ``.parquet``.
    SetupError
        If what writes Parquet is not installed.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(
            f"The table {path} must end in {' or '.join(SUFFIXES)}, which says how it is written; "
            "name it so."
        )
    if path.suffix.lower() == ".parquet" and find_spec("pyarrow") is None:
        raise SetupError(
            f"{path} needs pyarrow, which is not installed; in the clone: "
            "pip install -e '.[parquet]', or write a .csv file."
        )


def write_table(path: Path, dataset: xr.Dataset) -> None:
    """Write what is known of the whole part, one row a pose; the suffix says how.

    Raises
    ------
    InputError, SetupError
        As `check_table`, or the file cannot be written.
    """
    check_table(path)
    others = [name for name in dataset.sizes if name not in ("pose", "region")]
    table = dataset.drop_dims(others).sel(region=WHOLE_PART).drop_vars("region").to_dataframe()
    # A table has no header for what holds for all poses.
    table["wavelength_nm"] = dataset.attrs.get("wavelength_nm")
    with whole_file(path) as temporary:
        if path.suffix.lower() == ".csv":
            table.to_csv(temporary)
        else:
            table.to_parquet(temporary, engine="pyarrow")
