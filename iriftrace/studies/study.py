"""A study: one thing varied over modes, traced, and compared with references or timed."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from attrs import asdict, frozen

from iriftrace.core.errors import InputError
from iriftrace.core.files import check_readable, whole_file
from iriftrace.core.netcdf import check_netcdf
from iriftrace.field.index_field import IndexField
from iriftrace.image.differences import Hits, compare, own_size
from iriftrace.image.metrics import FEWEST_RAYS
from iriftrace.shells.stack import ShellStack
from iriftrace.studies.modes import CONTINUOUS, LINEAR_CELLS, Mode
from iriftrace.studies.picture import View, loaded_shells, picture_of_field, picture_of_shells
from iriftrace.studies.timing import COUNTS, REPEATS, STAGES, times
from iriftrace.sweep.journal import Journal, Piece, Progress, Work
from iriftrace.sweep.pose import fingerprint
from iriftrace.trace.query_replay import free_memory

if TYPE_CHECKING:
    import xarray as xr

SCHEMA = "iriftrace.study/1"

Variables = Mapping[str, tuple[str, type, str]]
"""Unit, type and description by name; counts that do not exist are -1, other numbers NaN."""

DIFFERENCES: Variables = {
    "rmse": ("mm", float, "root of the mean squared distance of the refracted hits"),
    "rmse_trimmed": ("mm", float, "the same without the 1 % of rays that differ most"),
    "median": ("mm", float, "median distance of the refracted hits"),
    "p95": ("mm", float, "95th percentile of the distance of the refracted hits"),
    "matched": ("1", int, "rays good in both runs"),
    "only_here": ("1", int, "rays good in this run only"),
    "only_reference": ("1", int, "rays good in the reference only"),
}
SIZES: Variables = {
    "displacement_median": ("mm", float, "median displacement of this run"),
    "displacement_p95": ("mm", float, "95th percentile of the displacement of this run"),
    "displacement_rms": ("mm", float, "root mean square displacement of this run"),
    "rays_good": ("1", int, "rays with status 0"),
    "rays_lost": ("1", int, "rays whose straight twin hits the part, but which are not good"),
    "shells": ("1", int, "shells that are not empty"),
    "triangles": ("1", int, "triangles of all shells"),
}
TIMES: Variables = {
    **{f"time_{stage}": ("s", float, text) for stage, text in STAGES.items()},
    "search_share": ("1", float, "search / refracted trace, median of pairs"),
    **{name: ("1", int, text) for name, text in COUNTS.items()},
}


@frozen(eq=False)
class Axis:
    """Quantity that a study varies: dimension in the file, numbers or names, name in figures."""

    name: str
    values: tuple[Any, ...]
    long_name: str


@frozen(eq=False)
class References:
    """Runs that every case of a study is compared with.

    ``"continuous"`` is the continuous engine on the field, ``"linear cells"`` likewise on the field
    that is linear in each cell, to which facet normals converge. Of any other name `stack` gives
    the shells for a case's mode, or None where none is left.
    """

    names: tuple[str, ...]
    field: IndexField
    stack: Callable[[Mode, str], ShellStack | None]


@frozen(eq=False)
class Study:
    """Cases along an axis, in each mode.

    Attributes
    ----------
    name : str
    axis : Axis
    modes : tuple of Mode
    view : callable
        From a position on the axis to the part, the camera and the variant.
    stack : callable
        From a mode and a position to the shells, or None where none is left.
    source : mapping
        Provenance, plain JSON values: files with their SHA-256, camera, air; see `source_of`.
    references : References or None
        Hits are compared with these; without them times are measured.
    """

    name: str
    axis: Axis
    modes: tuple[Mode, ...]
    view: Callable[[int], View]
    stack: Callable[[Mode, int], ShellStack | None]
    source: Mapping[str, Any]
    references: References | None = None

    def __attrs_post_init__(self) -> None:
        """Refuse what would be compared with nothing."""
        for what, some in (
            ("modes", [mode.name for mode in self.modes]),
            (self.axis.name, list(self.axis.values)),
            *((("references", list(self.references.names)),) if self.references else ()),
        ):
            if not some or len(set(some)) != len(some):
                raise InputError(
                    f"The study's {what} are {', '.join(map(str, some)) or 'none'}; give at least "
                    "one, each once."
                )


def source_of(view: View, fields: Sequence[IndexField], **more: Any) -> dict[str, Any]:
    """Where a study comes from, as plain JSON values."""
    return {
        "version": version("iriftrace"),
        "fields": [asdict(field.source) for field in fields],
        "part": {"path": str(view.part.path), "sha256": view.part.sha256},
        "air": asdict(fields[0].air),
        "wavelength_nm": fields[0].air.wavelength_nm,
        "camera": view.camera.as_dict(),
        "notes": dict(view.notes),
        "variant": view.variant,
        "length_unit": "mm",
        **more,
    }


def run_study(study: Study, path: str | Path, progress: Progress | None = None) -> xr.Dataset:
    """Trace every case, compare or time it, and write the result.

    Finished cases go into a journal: the same call goes on where an earlier one was interrupted or
    killed. References are traced when the first case needs them, so a study that goes on traces
    those again that are left.

    Parameters
    ----------
    study : Study
    path : path
        The netCDF file. If it is there and holds the same study, it is read and nothing is done.
    progress : callable, optional
        Called with the number of finished cases and of all cases.

    Returns
    -------
    xarray.Dataset
        With references ``SIZES`` over mode and axis, and ``DIFFERENCES`` over reference too: NaN
        (-1 for counts) where no shell is left. Else ``TIMES`` over mode and axis:
        ``search_share`` is the search's part of the refracted trace, the median of pairs that were
        measured one right after the other (more than 1 is noise); times of cases with another
        ``process`` come from another run of the program.

    Raises
    ------
    InputError
        If fewer than 100 rays of a compared case are good, the file cannot be written, or it
        belongs to another study.
    """
    names = study.references.names if study.references else ()
    identity = {
        "study": study.name,
        "axis": [study.axis.name, list(study.axis.values)],
        "modes": [mode.as_dict() for mode in study.modes],
        "references": list(names),
        **study.source,
    }
    work = Work(
        kind="study",
        parts="files or options",
        output=Path(path),
        request=fingerprint(version("iriftrace"), identity),
        total=len(study.axis.values) * len(study.modes),
    )
    measure = _compared(study, study.references) if study.references else _timed(study)

    def left(journal: Journal) -> Iterator[Piece]:
        for number in range(work.total):
            if number not in journal:
                # All modes at one place, because what is made for a place may be large.
                position, mode = divmod(number, len(study.modes))
                yield Piece(number, measure(study.modes[mode], position))

    def write(journal: Journal) -> None:
        dataset = _dataset(study, names, [journal.entry(number) for number in range(work.total)])
        dataset.attrs |= {"schema": SCHEMA, "request": work.request}
        with whole_file(path) as temporary:
            dataset.to_netcdf(temporary, engine="h5netcdf")

    return work.run(left, write, read_study, progress)


def _compared(study: Study, references: References) -> Callable[[Mode, int], dict[str, Any]]:
    @cache
    def of_field(normals: str) -> Hits:
        return picture_of_field(study.view(0), references.field, normals=normals)

    @cache
    def reference(mode: Mode, name: str) -> Hits | None:
        if name in (CONTINUOUS, LINEAR_CELLS):
            return of_field("gradient" if name == CONTINUOUS else "facet")
        stack = references.stack(mode, name)
        return None if stack is None else picture_of_shells(study.view(0), stack, mode)

    def measure(mode: Mode, position: int) -> dict[str, Any]:
        stack = study.stack(mode, position)
        if stack is None:
            return {"values": None, "differences": [None for _ in references.names]}
        here = picture_of_shells(study.view(position), stack, mode)
        good, rays = int(here.good.sum()), len(here.good)
        if good < FEWEST_RAYS:
            raise InputError(
                f"Only {good} of the {rays:,} rays of the study's picture are good, but its "
                f"numbers rest on at least {FEWEST_RAYS}; give more pixels (--scale), or let the "
                "camera look at the part."
            )
        others = [reference(mode, name) for name in references.names]
        differences = [None if one is None else compare(here, one).as_dict() for one in others]
        return {"values": own_size(here), "differences": differences}

    return measure


def _timed(study: Study) -> Callable[[Mode, int], dict[str, Any]]:
    def measure(mode: Mode, position: int) -> dict[str, Any]:
        free_memory()
        stack = study.stack(mode, position)
        if stack is None:
            raise InputError(
                f"The mode '{mode.name}' leaves no shell that the field reaches; give more layers, "
                "or leave fewer inner ones out."
            )
        shells, triangles = len(stack.shells), stack.triangles
        context = loaded_shells(study.view(position), stack, mode)
        # Millions of triangles need not be in memory twice.
        del stack
        with context as scene:
            counts = {"triangles": triangles, "triangles_per_shell": triangles // shells}
            return {"values": {**times(scene), **counts}, "differences": []}

    return measure


def _dataset(study: Study, references: Sequence[str], entries: Sequence[dict[str, Any]]) -> Any:
    import xarray as xr

    axis, over = study.axis, (study.axis.name, "mode")
    shape = (len(axis.values), len(study.modes))
    cases = [entry["values"] for entry in entries]
    pairs = [one for entry in entries for one in entry["differences"]]
    sizes, differences = (SIZES, DIFFERENCES) if references else (TIMES, {})
    names = any(isinstance(value, str) for value in axis.values)
    described = np.array([mode.describe() for mode in study.modes], dtype=object)
    dataset = xr.Dataset(
        {
            **_variables(sizes, cases, over, shape),
            **_variables(differences, pairs, (*over, "reference"), (*shape, len(references))),
        },
        coords={
            "mode": np.array([mode.name for mode in study.modes], dtype=object),
            "mode_description": ("mode", described),
            axis.name: (
                axis.name,
                np.array(axis.values, dtype=object if names else None),
                {"long_name": axis.long_name, **({} if names else {"units": "1"})},
            ),
            **({"reference": np.array(references, dtype=object)} if references else {}),
        },
        attrs={
            "study": study.name,
            "modes": json.dumps([mode.as_dict() for mode in study.modes]),
            **({} if references else {"repeats": REPEATS}),
            **{
                key: value if isinstance(value, str | int | float) else json.dumps(value)
                for key, value in study.source.items()
            },
        },
    )
    return dataset.transpose("mode", axis.name, ...)


def _variables(
    variables: Variables,
    rows: Sequence[Mapping[str, Any] | None],
    over: tuple[str, ...],
    shape: tuple[int, ...],
) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, (unit, kind, text) in variables.items():
        missing = -1 if kind is int else np.nan
        values = [missing if row is None else row[name] for row in rows]
        shaped: Any = np.array(values, dtype=kind).reshape(shape)
        found[name] = (over, shaped, {"units": unit, "long_name": text})
    return found


def read_study(path: str | Path) -> xr.Dataset:
    """Read a study that :func:`run_study` wrote.

    Raises
    ------
    InputError
        If the file is missing, no netCDF, or of another program.
    """
    import xarray as xr

    if not Path(path).is_file():
        raise InputError(f"There is no study {path}; `iriftrace study` writes one.")
    check_readable(Path(path))
    check_netcdf(Path(path))
    try:
        with xr.open_dataset(path, engine="h5netcdf") as file:
            dataset: xr.Dataset = file.load()
    except Exception as error:  # xarray decodes what a damaged file states, with any error
        raise InputError(f"{path} is no netCDF file ({error}); give a study.") from error
    if dataset.attrs.get("schema") != SCHEMA:
        raise InputError(
            f"{path} has schema {dataset.attrs.get('schema')!r} instead of {SCHEMA!r}, so it is no "
            "study of this version of iriftrace; run the study again."
        )
    return dataset


def is_study(path: str | Path) -> bool:
    """True if a file is a study's and no other netCDF file."""
    import xarray as xr

    try:
        check_netcdf(Path(path))
        with xr.open_dataset(path, engine="h5netcdf") as file:
            return str(file.attrs.get("schema", "")).startswith(SCHEMA.partition("/")[0] + "/")
    except (OSError, ValueError, KeyError):
        return False


def reference_words(reference: str) -> str:
    """Name of a reference in figures and tables."""
    if reference.isdecimal():
        return f"{reference} shells of the same mode"
    return {
        "same mode": "the finest field, same mode",
        CONTINUOUS: "the continuous engine",
        LINEAR_CELLS: "the continuous engine, linear cells",
    }[reference]
