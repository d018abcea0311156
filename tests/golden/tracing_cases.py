"""Renderings, two devices, sweeps and plans, scenes from a field."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from internals import (
    camera_values,
    command,
    dataset_values,
    field_values,
    image_values,
    pair_values,
    plan_values,
    shell_values,
)
from values import HERE, SCENES, Record, digest, numbers_of

import iriftrace

NAMES = (
    *("bevel_gear", "concentric_cylinders", "cylinder", "fringe_cylinder", "gear_tooth"),
    *("hot_plate", "hybrid_cylinder", "slab", "wishbone"),
)
SMALL = ("-D", "scale=0.1")


def rendered(scene: Path, output: str, *options: str) -> Any:
    """Metrics of a rendering by the command."""
    command("render", scene, "-o", output, "--no-figures", *SMALL, *options)
    return numbers_of(Path(output).with_suffix(".json"))


# 1 --- renderings


def render(record: Record) -> None:
    """The bundled scenes through shells; through cells and by the engine's test where it can."""
    for name in NAMES:
        scene = SCENES / name / "scene.xml"
        record(name, partial(rendered, scene, f"{name}.exr", "--engine=shells"))
    for name in ("cylinder", "hot_plate"):
        scene = SCENES / name / "scene.xml"
        record(f"{name}, cells", partial(rendered, scene, f"{name}_c.exr", "--engine=cells"))
        record(f"{name}, auto", partial(rendered, scene, f"{name}_a.exr"))
    record("image", lambda: image_values(HERE / "cylinder.exr"))
    scene = SCENES / "cylinder" / "scene.xml"
    options = ("-D", "normals=facet", "--wavelength=450 nm")
    record("facets, other light", partial(rendered, scene, "f.exr", *options))

    def again() -> Any:
        command("metrics", "cylinder.exr", "-o", "again.json")
        return numbers_of("again.json")

    record("metrics again", again)


# 2 --- two devices, and the air that was measured


def two_devices(record: Record) -> None:
    """Measurement of the bundled fringe sensor, and its correction."""
    import pyvista as pv

    scene = SCENES / "fringe_cylinder" / "scene.xml"

    def arrays(cloud: str) -> dict[str, Any]:
        data = pv.read(cloud)
        return {"points": np.asarray(data.points), **dict(data.point_data.items())}

    def measured(*options: str) -> dict[str, Any]:
        command("measure", scene, "-o", "scan.vtp", "--no-figures", *SMALL, *options)
        return {"numbers": numbers_of("scan.json"), "cloud": arrays("scan.vtp")}

    def corrected(*options: str) -> dict[str, Any]:
        words = ("correct", "scan.vtp", scene, "-o", "corrected.vtp", "--no-figures")
        command(*words, *SMALL, *options)
        return {"numbers": numbers_of("corrected.json"), "cloud": arrays("corrected.vtp")}

    record("measure", measured)
    record("correct", corrected)
    record("correct, U", lambda: corrected("--field-uncertainty=5 %", "--gate=none"))


def fit(record: Record) -> None:
    """Weights of four members from a board's shifts, and the comparison with one of them."""
    from attrs import evolve

    from validation.inputs import leaning_air as twin

    camera = twin.BOARD_CAMERA.scaled(0.2)
    fields = [twin.leaning(lean, HERE) for lean in (0.0, 0.2, 0.4, 0.6)]
    board = iriftrace.Scene(
        twin.BOARD.part.transformed(twin.UPRIGHT),
        iriftrace.HotAir(fields, layers=9),
        camera,
        second=twin.LEEWARD[1],
        second_id="camera_2",
        blockers=[twin.hot_block_part()],
        engine="shells",
    )
    truth = evolve(board, air=iriftrace.HotAir(twin.leaning(0.3, HERE), layers=9))
    one = evolve(board, air=iriftrace.HotAir(fields[1], layers=9))

    def shifts() -> dict[str, Any]:
        seen = twin.measured_shifts(truth, 0.01)
        table = np.column_stack((seen.places, seen.shifts))
        np.savetxt("s.csv", table, "%.9g", ",", header="u,v,du,dv", comments="")
        return {"places": seen.places, "shifts": seen.shifts}

    def fitted(output: str, *options: str) -> Any:
        words = ("fit", "board/scene.xml", "s.csv", "-o", f"{output}/scene.xml")
        command(*words, "--engine=shells", *options)
        return numbers_of(f"{output}/fit.json")

    def compared() -> Any:
        one.save("one/scene.xml", scale=1.0)
        command("render", "one/scene.xml", "-o", "one.exr", "--no-figures", "--engine=shells")
        command("compare", "one.exr", "s.csv", "-o", "c.json", "--no-figures")
        found = numbers_of("c.json")
        # The image's header has the times that its steps took.
        found.pop("image")
        return found

    record("shifts", shifts)
    board.save("board/scene.xml", scale=1.0)
    record("fit", partial(fitted, "fitted"))
    record("fit, camera motion", partial(fitted, "moved", "--camera-motion"))
    record("ensemble", partial(rendered, Path("fitted/scene.xml"), "fitted.exr", "--engine=shells"))
    record("compare", compared)

    def temperatures() -> Any:
        places = np.random.default_rng(2).uniform((-8, -4, 8), (14, 4, 24), (12, 3))
        sampled = twin.leaning(0.3, HERE)
        kelvin = sampled.air.temperature(sampled.sample(places))
        table = np.column_stack((places, kelvin))[np.isfinite(kelvin)]
        np.savetxt("t.csv", table, "%.9g", ",", header="x,y,z,T (K)", comments="")
        command("fit", "board/scene.xml", "t.csv", "-o", "by_t/scene.xml")
        return numbers_of("by_t/fit.json")

    record("fit, temperatures", temperatures)


# 3 --- sweeps and plans


def sweep(record: Record) -> None:
    """Nine poses of the cylinder, three of a sensor of two devices, and plans of both."""

    def swept(name: str, file: str, *options: str) -> dict[str, Any]:
        command("sweep", SCENES / name / "scene.xml", "-o", file, *SMALL, *options)
        return dataset_values(iriftrace.read_sweep(file))

    nine = ("--azimuth=0:90:3", "--elevation=-60:60:3")
    record("nine poses", partial(swept, "cylinder", "sweep.nc", *nine))
    three = ("--azimuth=240:300:3", "--elevation=20")
    record("two devices", partial(swept, "fringe_cylinder", "rig.nc", *three))

    def planned(file: str, views: iriftrace.Views | None = None, **criteria: Any) -> Any:
        data = iriftrace.read_sweep(file)
        return plan_values(iriftrace.plan(data, iriftrace.Criteria(**criteria), views=views))

    record("plan", lambda: planned("sweep.nc"))
    record("plan of a median", lambda: planned("sweep.nc", statistic="median", region="lateral"))
    record("plan, views", lambda: planned("sweep.nc", views=iriftrace.Views(3)))
    record("plan of two devices", lambda: planned("rig.nc"))

    def pairs() -> Any:
        return pair_values(
            iriftrace.plan_pairs(
                iriftrace.read_sweep("sweep.nc"), pairing=iriftrace.Pairing(confirm=False)
            )
        )

    record("plan, pairs", pairs)
    # The texts, whose numbers are rounded.
    plan = ("plan", "sweep.nc")
    record("text of plan", lambda: command(*plan).splitlines())
    record("text of views", lambda: command(*plan, "--views=3").splitlines())
    record("text of pairs", lambda: command(*plan, "--pairs", "--no-confirm").splitlines())

    def saved() -> Any:
        command(*plan, "--save-poses", "best.json")
        return numbers_of("best.json")

    def refined(*options: str) -> Any:
        command(*plan, *options, "--refine", "--evaluations=10", "-o", "refined.json")
        return numbers_of("refined.json")

    record("poses of plan", saved)
    record("refined pose", refined)
    record("refined pair", lambda: refined("--pairs", "--no-confirm"))


# 4 --- from a field to a scene


def scene(record: Record) -> None:
    """Synthetic air around a cylinder: field, shells, scene; in memory, saved, loaded."""
    command("part", "cylinder", "-o", "part.ply")
    wall = "--wall-temperature=900 degC"
    coarse = ("--cell-size=4 mm", "--sides=15 mm", "--height=30 mm")
    camera = (
        *("--resolution=120,100", "--scale=1", "--sensor=6,5", "--focal-length=6"),
        *("--focus=50:450", "--origin=150,-150,120"),
    )

    def field() -> Any:
        command("field", "synthetic", "part.ply", "-o", "air.vtu", wall, "--gradient", *coarse)
        weaker = "--wall-temperature=850 degC"
        command("field", "synthetic", "part.ply", "-o", "air_2.vtu", weaker, *coarse)
        return field_values(iriftrace.read_field("air.vtu"))

    def made(folder: str, *options: str) -> Any:
        command("scene", "air.vtu", "part.ply", "-o", f"{folder}/scene.xml", *camera, *options)
        return folder_values(folder)

    def shells() -> Any:
        command("shells", "air.vtu", "-o", "shells", "--part=part.ply", "--layers=5")
        return {
            "table": numbers_of("shells/shells.json"),
            "shells": shell_values(iriftrace.load_shells("shells")),
        }

    def contoured(rule: str) -> Any:
        field = iriftrace.read_field("air.vtu")
        return shell_values(iriftrace.contour_shells(field, 4, rule=rule))

    record("field", field)
    record("shells", shells)
    for rule in ("midpoint", "graded", "outer"):
        record(f"shells, {rule}", partial(contoured, rule))
    record("scene", lambda: made("scene", "--layers=7"))
    record("scene, pose", lambda: rendered(Path("scene/scene.xml"), "out.exr", "-D", "scale=1"))
    record("scene, loaded", lambda: loaded_values("scene/scene.xml"))

    def edited(*options: str) -> Any:
        command("shells", "air.vtu", "-o", "edited", "--layers=4", *options)
        return shell_values(iriftrace.load_shells("edited"))

    record("smoothed", lambda: edited("--smooth=3"))
    record("subdivided", lambda: edited("--subdivide=1"))
    record("without inner", lambda: edited("--drop-inner=1"))
    record("trimmed", lambda: made("trimmed", "--layers=4", "--trim=5 mm"))
    record("decimated", lambda: made("decimated", "--layers=7", "--triangles=4000"))

    def grown() -> Any:
        hot = ("--hot-temperature=900 degC", "--hot-temperature=head +x=880 degC")
        found = made("grown", "--layers=4", "--expansion=14e-6/K", *hot)
        return {"folder": found, "loaded": loaded_values("grown/scene.xml")}

    record("grown", grown)
    ensemble = ("--layers=5", "--member=air_2.vtu")
    record("ensemble", lambda: made("ensemble", *ensemble))
    xml = Path("ensemble/scene.xml")
    record("ensemble, pose", lambda: rendered(xml, "both.exr", "-D", "scale=1"))
    record("second member", lambda: rendered(xml, "two.exr", "-D", "scale=1", "-D", "member=2"))
    record("ensemble, loaded", lambda: loaded_values("ensemble/scene.xml"))

    def measured(system: str) -> Any:
        made(system, "--layers=5", "--second=150,-120,120", f"--system={system}")
        scan = f"{system}.vtp"
        command("measure", f"{system}/scene.xml", "-o", scan, "--no-figures", "-D", "scale=1")
        return numbers_of(f"{system}.json")

    for system in ("fringe", "stereo", "laser"):
        record(f"measure, {system}", partial(measured, system))

    def in_memory() -> Any:
        value = iriftrace.Scene(
            iriftrace.read_part("part.ply"),
            iriftrace.HotAir(iriftrace.read_field("air.vtu"), layers=7),
            iriftrace.Camera(
                focal_length_mm=6.0,
                sensor_mm=(6.0, 5.0),
                resolution=(120, 100),
                focus_mm=(50.0, 450.0),
                matrix=iriftrace.look_at((150.0, -150.0, 120.0), (0.0, 0.0, 0.0)),
            ),
        )
        iriftrace.render_scene(value).save("memory.exr")
        value.save("saved/scene.xml", scale=1.0)
        return numbers_of("memory.json")

    def after_saving() -> Any:
        loaded = iriftrace.load_scene("saved/scene.xml")
        iriftrace.render_scene(loaded).save("loaded.exr")
        return numbers_of("loaded.json")

    record("in memory", in_memory)
    record("saved", lambda: folder_values("saved"))
    record("saved and loaded", after_saving)


def folder_values(folder: str) -> dict[str, Any]:
    """Digests of the arrays of all field files and shells of a scene's folder, and its tables.

    By their number in the order of their names, so that folders may be arranged otherwise.
    """
    files = sorted(file for file in Path(folder).rglob("*") if file.is_file())
    found: dict[str, Any] = {"files": dict.fromkeys((file.name for file in files), "")}
    for number, file in enumerate(file for file in files if file.name == "field.npz"):
        with np.load(file) as arrays:
            kept = {name: digest(arrays[name]) for name in arrays if name != "header"}
        found[f"field {number}"] = kept
    for number, file in enumerate(file for file in files if file.name == "shells.json"):
        found[f"table {number}"] = numbers_of(file)
        found[f"shells {number}"] = shell_values(iriftrace.load_shells(file.parent))
    return found


def loaded_values(xml: str) -> dict[str, Any]:
    """Devices and part of a scene that is read."""
    loaded = iriftrace.load_scene(xml)
    return {
        "camera": camera_values(loaded.camera),
        "vertices": digest(np.asarray(loaded.part.vertices, dtype=np.float64)),
        "faces": digest(np.asarray(loaded.part.faces, dtype=np.int64)),
    }
