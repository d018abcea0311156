"""Arrays and netCDF files whose bytes are not what their headers state."""

import io
import pickle
import re
import zipfile
from pathlib import Path

import h5netcdf
import numpy as np
import pytest
from numpy.testing import assert_array_equal

import iriftrace
from iriftrace.core.errors import InputError
from iriftrace.core.files import array_in, arrays_in
from iriftrace.io.netcdf import check_netcdf


def _bytes_of(array: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


@pytest.mark.parametrize("order", ["C", "F"])
def test_arrays_come_back_as_numpy_reads_them(order: str) -> None:
    array = np.asarray(np.arange(24.0).reshape(2, 3, 4), order=order)
    assert_array_equal(array_in(_bytes_of(array)), array)


def test_a_length_that_is_not_there_takes_no_memory() -> None:
    """Before, 2e10 numbers were allocated, 149 GiB."""
    content = _bytes_of(np.zeros(10)).replace(b"(10,), }          ", b"(20000000000,), } ")
    with pytest.raises(ValueError, match="states 160,000,000,000 bytes instead of 80"):
        array_in(content)


class _Trap:
    """What would act when it is unpickled."""

    def __reduce__(self) -> tuple[object, tuple[str]]:
        return (pytest.fail, ("an array was unpickled",))


def test_nothing_is_unpickled(tmp_path: Path) -> None:
    trap = np.array([_Trap()], dtype=object)
    with pytest.raises(ValueError, match="something else than arrays"):
        array_in(_bytes_of(trap))
    np.savez(tmp_path / "trap.npz", points=trap)
    with pytest.raises(ValueError, match="something else than arrays"):
        arrays_in(tmp_path / "trap.npz", ["points"])
    with pytest.raises(ValueError, match="something else than arrays"):
        array_in(pickle.dumps(_Trap()))


def test_no_module_loads_pickles() -> None:
    sources = [file.read_text() for file in Path(iriftrace.__file__).parent.rglob("*.py")]
    for source in sources:
        assert not re.search(
            r"\bpickle\.load|import pickle|allow_pickle=True|np\.load\((?!.*allow_pickle=False)",
            source,
        )


def test_a_file_of_kilobytes_does_not_fill_the_memory(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "bomb.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("points.npy", _bytes_of(np.zeros(10**7)))
    with pytest.raises(ValueError, match="would unpack to 80,000,128"):
        arrays_in(tmp_path / "bomb.npz", ["points"])


def test_a_variable_that_no_one_needs(tmp_path: Path) -> None:
    """HDF5 stores nothing of it, and reading it takes 8 GB."""
    with h5netcdf.File(tmp_path / "bomb.nc", "w") as file:
        file.dimensions["pose"] = 10**9
        file.create_variable("huge", ("pose",), np.dtype("f8"), chunks=(1000,))
    with pytest.raises(InputError, match="would unpack to 8,000,000,000"):
        check_netcdf(tmp_path / "bomb.nc")


def test_a_damaged_chunk_is_found_before_it_is_read(tmp_path: Path) -> None:
    values = np.random.default_rng(1).random(100_000)
    with h5netcdf.File(tmp_path / "data.nc", "w") as file:
        file.dimensions["pose"] = len(values)
        file.create_variable("data", ("pose",), data=values, compression="gzip", chunks=(1000,))
    check_netcdf(tmp_path / "data.nc")
    content = bytearray((tmp_path / "data.nc").read_bytes())
    middle = len(content) // 2
    content[middle : middle + 2000] = bytes(2000)
    (tmp_path / "data.nc").write_bytes(content)
    with pytest.raises(InputError, match="cannot be read"):
        check_netcdf(tmp_path / "data.nc")
