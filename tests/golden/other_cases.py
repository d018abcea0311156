"""Flows, parts, studies, and the names of commands and functions."""

from __future__ import annotations

import inspect
import json
import re
import warnings
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from internals import (
    command,
    part_regions,
    study_values,
)
from values import HERE, SCENES, Record, digest, numbers_of, of_text

import iriftrace

# 6 --- flows


def flow(record: Record) -> None:
    """Texts of OpenFOAM cases that are only written, and checks of two fields."""
    import trimesh

    trimesh.creation.box((60.0, 30.0, 20.0)).export("part.stl")
    table = trimesh.creation.box((200.0, 200.0, 5.0))
    table.apply_translation((0.0, 0.0, -20.0))
    table.export("table.stl")
    wall = "--wall-temperature=1100 degC"

    def case(folder: str, *options: str) -> Any:
        words = ("field", "simulate", "part.stl", "-o", folder, *options)
        command(*words, "--write-only")
        return {
            file.relative_to(folder).as_posix(): _content(file)
            for file in sorted(Path(folder).rglob("*"))
            if file.is_file()
        }

    record("case", lambda: case("plain", wall))
    regions = ("--region-temperature=* +z*=450 degC", "--transition=5 mm")
    record("case, regions", lambda: case("regions", wall, *regions))
    many = ("--symmetry=y", "--resolution=coarse", "--snapshots=2", "--end-time=1 s")
    record("case, half", lambda: case("half", wall, *many, "--ambient=30 degC"))
    record(
        "case, body", lambda: case("body", wall, "--body=table.stl", "--body-temperature=80 degC")
    )
    record("case, floor", lambda: case("floor", wall, "--floor=-30 mm"))
    wind = ("--draught=0.1 m/s", "--draught-from=0")
    record("case, draught", lambda: case("wind", wall, *wind))
    np.savetxt(
        "wall.csv",
        [(x, y, z, 1000.0 + x) for x in (-30, 0, 30) for y in (-15, 15) for z in (-10, 10)],
        "%g",
        ",",
        header="x (mm),y (mm),z (mm),T (K)",
        comments="",
    )
    record("case, measured", lambda: case("measured", "--wall-temperature-from=wall.csv"))

    def check(field: Any, part: Any, *options: str) -> Any:
        command("field", "check", field, part, "-o", "check.json", *options)
        return numbers_of("check.json")

    bundled = SCENES / "cylinder"
    of_it = (bundled / "field.vtu", bundled / "part.ply")
    record("check", lambda: check(*of_it, "--wall-temperature=1100 degC", "--origin=0,0,400"))

    def synthetic() -> Any:
        coarse = ("--cell-size=2 mm", "--sides=20 mm", "--height=40 mm")
        command("field", "synthetic", "part.stl", "-o", "air.vtu", wall, *coarse, *regions)
        return check("air.vtu", "part.stl", wall)

    record("check of synthetic air", synthetic)

    def heat() -> Any:
        """With velocities: those of a vertical draught through the synthetic air."""
        import pyvista as pv

        grid = pv.read("air.vtu")
        grid.point_data["U"] = np.tile((0.0, 0.0, 0.3), (grid.n_points, 1))
        grid.save("flow.vtu")
        return check("flow.vtu", "part.stl", wall)

    record("check with velocities", heat)


def _content(file: Path) -> Any:
    raw = file.read_bytes()
    if file.suffix in (".stl", ".vtp", ".vtu", ".ply"):
        return digest(np.frombuffer(raw, dtype=np.uint8))
    return json.loads(raw) if file.suffix == ".json" else of_text(raw.decode("latin-1"))


# parts and studies, which leave the package


def parts(record: Record) -> None:
    """Meshes by dimensions, and a mesh with fewer and with more triangles."""

    def made(*words: str) -> dict[str, Any]:
        command("part", *words, "-o", "part.ply")
        part = iriftrace.read_part("part.ply")
        return {
            "vertices": digest(np.asarray(part.vertices, dtype=np.float64)),
            "faces": digest(np.asarray(part.faces, dtype=np.int64)),
            "bounds": part.bounds,
            "regions": part_regions(part),
        }

    for kind in ("cylinder", "sphere", "ball-bar", "plate", "board", "gear", "hybrid", "wishbone"):
        record(kind, partial(made, kind))
    command("part", "cylinder", "-o", "fine.ply")
    record("decimate", lambda: made("decimate", "fine.ply", "--faces=500"))
    record("subdivide", lambda: made("subdivide", "fine.ply", "--edge=5 mm"))


def studies(record: Record) -> None:
    """Three of the paper's studies of the small hot block."""
    from validation.inputs import hot_block

    field, part = map(str, hot_block.save(HERE))
    hot_block.air(12).save("finer.vtu")
    camera = [word for word in hot_block.CAMERA if not word.startswith(("--resolution", "--scale"))]
    small = (*camera, "--resolution=60,50", "--scale=1")
    record("layers", lambda: study_values("layers", field, part, "--layers=2:3", *small))
    mesh = (field, part, "finer.vtu", "--layers=2", "--split", field)
    record("mesh", lambda: study_values("mesh", *mesh, *small))
    smoothing = (field, part, "finer.vtu", "--iterations=0,2", "--layers=2")
    record("smoothing", lambda: study_values("smoothing", *smoothing, *small))


# 7 --- names


def names(record: Record) -> None:
    """Help of every command, and public names with their parameters."""

    def helped(*words: str) -> str:
        return command(*words, "--help")

    def listed(text: str) -> list[str]:
        """A help text without its frame."""
        lines = (" ".join(line.strip("│╭╮╰╯─ ").split()) for line in text.splitlines())
        return [line for line in lines if line]

    def options(words: tuple[str, ...]) -> dict[str, str]:
        """Options and arguments by name, with the rest of their line."""
        rows = [line for line in listed(helped(*words)) if re.match(r"(\* )?([A-Z_]+ )?--", line)]
        found = {}
        for row in rows:
            spelt = re.match(r"(?:\* )?((?:(?:[A-Z_-]+|--?[A-Za-z-]+)\s)+)(.*)", row + " ")
            if spelt:
                found[" ".join(w for w in spelt[1].split() if w.startswith("-"))] = row
        return found

    def below(words: tuple[str, ...]) -> list[str]:
        text = helped(*words)
        if "Commands ─" not in text:
            return []
        inside = text.split("Commands ─")[1].split("╰")[0]
        return re.findall(r"^│ +([a-z][a-z-]*) ", inside, re.MULTILINE)

    for name in below(()):
        for words in ((name,), *((name, sub) for sub in below((name,)))):
            record(f"help of {' '.join(words)}", partial(options, words))
    for name in sorted(iriftrace.__all__):
        record(f"iriftrace.{name}", partial(_parameters, name))


def _parameters(name: str) -> Any:
    public = getattr(iriftrace, name)
    if not callable(public):
        return type(public).__name__
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            found = inspect.signature(public).parameters.values()
        except ValueError:
            found = ()
    return {one.name: str(one.replace(annotation=inspect.Parameter.empty)) for one in found}
