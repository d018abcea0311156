"""Writes OpenFOAM cases: polyMesh and scalar fields, whole or decomposed, as the solvers do."""

from __future__ import annotations

import gzip
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from attrs import evolve
from numpy.typing import NDArray

from validation.field_files.openfoam_mesh import (
    FaceMesh,
    FloatArray,
    IntArray,
    Patch,
    face_mesh,
    reversed_faces,
)

Form = Literal["ascii", "gz", "binary"]

CONTROL = "application buoyantPimpleFoam;\nstartTime 0;\nendTime 10;\ndeltaT 1;\nwriteInterval 1;\n"


def write_case(
    folder: Path,
    grid: Any,
    fields: Mapping[str, Mapping[str, FloatArray]],
    patches: Sequence[Patch],
    *,
    groups: IntArray | None = None,
    processors: IntArray | None = None,
    form: Form = "ascii",
) -> Path:
    """Write a case, of which OpenFOAM's own checkMesh says "Mesh OK"; returns its folder.

    The grid has linear cells, m. `fields` has scalar fields by name, cell values (c,), for each
    time as its folder is called. Cells of the grid with one number (cells,) of `groups` become one
    polyhedron; the fields are of these. `processors` (c,) has each cell's for a decomposed case.
    The `form` ``"gz"`` is compressed text, as ``writeCompression on`` leaves it.
    """
    mesh = face_mesh(grid, patches, groups)
    _write(folder / "system/controlDict", "dictionary", "controlDict", CONTROL, "ascii")
    if processors is None:
        _write_part(folder, mesh, patches, fields, form)
        return folder
    for number in range(int(processors.max()) + 1):
        _write_processor(folder, mesh, patches, fields, processors, number, form)
    return folder


def _write_part(
    folder: Path,
    mesh: FaceMesh,
    patches: Sequence[Patch],
    fields: Mapping[str, Mapping[str, FloatArray]],
    form: Form,
    links: Sequence[tuple[int, int]] = (),
) -> None:
    """A mesh and its fields; `links` are the numbers of this and of the other processor."""
    geometry = folder / "constant/polyMesh"
    points = [f"({x:.17g} {y:.17g} {z:.17g})" for x, y, z in mesh.points]
    lists = {
        "points": ("vectorField", _binary(mesh.points) if form == "binary" else _list(points)),
        "faces": _faces(mesh.faces, form),
        "owner": ("labelList", _labels(mesh.owner, form)),
        "neighbour": ("labelList", _labels(mesh.neighbour, form)),
    }
    for name, (kind, text) in lists.items():
        _write(geometry / name, kind, name, text, form)
    entries, start = [], len(mesh.neighbour)
    kinds = [p.kind for p in patches] + ["processor"] * len(links)
    names = [p.name for p in patches] + [f"procBoundary{a}to{b}" for a, b in links]
    for place, (name, kind, size) in enumerate(zip(names, kinds, mesh.sizes, strict=True)):
        extra = ""
        if place >= len(patches):
            mine, other = links[place - len(patches)]
            extra = f" myProcNo {mine}; neighbProcNo {other};"
        entries.append(
            f"    {name}\n    {{\n        type {kind};\n        nFaces {size};\n"
            f"        startFace {start};{extra}\n    }}"
        )
        start += size
    _write(geometry / "boundary", "polyBoundaryMesh", "boundary", _list(entries), form)
    for time, arrays in fields.items():
        for name, values in arrays.items():
            others = [f"procBoundary{a}to{b}" for a, b in links]
            text = _field(_scalars(values, form), patches, others, name)
            _write(folder / time / name, "volScalarField", name, text, form, time)


def _write_processor(
    folder: Path,
    mesh: FaceMesh,
    patches: Sequence[Patch],
    fields: Mapping[str, Mapping[str, FloatArray]],
    processors: NDArray[np.int64],
    number: int,
    form: Form,
) -> None:
    cells = np.flatnonzero(processors == number)
    local = np.full(len(processors), -1)
    local[cells] = np.arange(len(cells))
    count = len(mesh.neighbour)
    one, two = processors[mesh.owner[:count]], processors[mesh.neighbour]
    inner = np.flatnonzero((one == number) & (two == number))
    patch = np.repeat(np.arange(len(patches)), mesh.sizes)
    mine = np.flatnonzero(processors[mesh.owner[count:]] == number)
    chosen, owners, sizes = [inner], [mesh.owner[inner]], []
    for place in range(len(patches)):
        part = count + mine[patch[mine] == place]
        chosen.append(part)
        owners.append(mesh.owner[part])
        sizes.append(len(part))
    links = []
    faces = mesh.faces.copy()
    for other in range(int(processors.max()) + 1):
        away = np.flatnonzero((one == number) & (two == other) & (other != number))
        back = np.flatnonzero((two == number) & (one == other) & (other != number))
        # Seen from its own cell, each face turns its back.
        faces[back] = reversed_faces(faces[back])
        part = np.concatenate((away, back))
        if len(part):
            links.append((number, other))
            chosen.append(part)
            owners.append(np.concatenate((mesh.owner[away], mesh.neighbour[back])))
            sizes.append(len(part))
    faces = faces[np.concatenate(chosen)]
    used = np.unique(faces[faces >= 0])
    place_of = np.full(len(mesh.points) + 1, -1)
    place_of[used] = np.arange(len(used))
    sub = evolve(
        mesh,
        points=mesh.points[used],
        faces=place_of[faces],
        owner=local[np.concatenate(owners)],
        neighbour=local[mesh.neighbour[inner]],
        sizes=tuple(sizes),
    )
    here = {t: {n: v[cells] for n, v in arrays.items()} for t, arrays in fields.items()}
    _write_part(folder / f"processor{number}", sub, patches, here, form, links)


def _field(values: str, patches: Sequence[Patch], links: Sequence[str], name: str) -> str:
    lines = [f"dimensions [0 0 0 {int(name == 'T')} 0 0 0];", "", "internalField   nonuniform"]
    lines.append(f"List<scalar>\n{values};\n\nboundaryField\n{{")
    for patch in patches:
        entry = (
            "zeroGradient;"
            if patch.value is None
            else (f"fixedValue;\n        value uniform {patch.value:.17g};")
        )
        lines.append(f"    {patch.name}\n    {{\n        type {entry}\n    }}")
    for link in links:
        lines.append(
            f"    {link}\n    {{\n        type processor;\n        value uniform 0;\n    }}"
        )
    return "\n".join([*lines, "}"])


def _faces(faces: IntArray, form: Form) -> tuple[str, str]:
    """Class and text of the faces; in binary their corners follow each other without counts."""
    if form == "binary":
        there = faces >= 0
        starts = np.concatenate(([0], np.cumsum(there.sum(axis=1))))
        return "faceCompactList", f"{_labels(starts, form)}\n{_labels(faces[there], form)}"
    return "faceList", _list(
        [f"3({a} {b} {c})" if d < 0 else f"4({a} {b} {c} {d})" for a, b, c, d in faces.tolist()]
    )


def _labels(values: IntArray, form: Form) -> str:
    if form == "binary":
        return _binary(values.astype(np.int32))
    return _list([str(n) for n in values.tolist()])


def _scalars(values: FloatArray, form: Form) -> str:
    return _binary(values) if form == "binary" else _list([f"{v:.17g}" for v in values])


def _binary(values: NDArray[np.generic]) -> str:
    """Numbers byte by byte, as characters of Latin-1."""
    return f"{len(values)}\n({np.ascontiguousarray(values).tobytes().decode('latin-1')})"


def _list(items: Sequence[str]) -> str:
    return "\n".join([str(len(items)), "(", *items, ")"])


def _write(
    path: Path, kind: str, name: str, text: str, form: Form, time: str = "constant/polyMesh"
) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    written = 'binary;\n    arch "LSB;label=32;scalar=64"' if form == "binary" else "ascii"
    head = (
        f"FoamFile\n{{\n    version 2.0;\n    format {written};\n"
        f'    class {kind};\n    location "{time}";\n    object {name};\n}}\n\n'
    )
    content = f"{head}{text}\n".encode("latin-1")
    if form == "gz":
        path.with_name(path.name + ".gz").write_bytes(gzip.compress(content))
    else:
        path.write_bytes(content)


def entry(path: Path, key: str) -> str:
    """Value of the first entry of a name in an OpenFOAM file."""
    found = re.search(rf"^\s*{key}\s+([^;]+);", path.read_text(encoding="utf-8"), re.M)
    assert found, (path, key)
    return found[1]
