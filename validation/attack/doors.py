"""The formats that commands read, and the reader of each."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from fnmatch import fnmatch
from pathlib import Path

from attrs import frozen

from iriftrace.io.calibration import read_calibration, read_stereo_calibration
from iriftrace.io.clouds import read_cloud
from iriftrace.io.exr import read_exr, read_part_of
from iriftrace.io.field import read_field
from iriftrace.io.field_npz import FIELD_FILE, load_field_file
from iriftrace.io.iso_surfaces import import_shells
from iriftrace.io.lost_rays import read_lost_rays
from iriftrace.io.measured_shift import read_measured_shift
from iriftrace.io.part_files import read_part
from iriftrace.io.poses import read_poses
from iriftrace.io.shells import load_shells
from iriftrace.photo.prints import read_print
from iriftrace.sweep.journal import journal_of, open_journal
from iriftrace.sweep.store import read_sweep
from iriftrace.tracing.hot_air import HotAir
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.scene import Scene
from validation.attack import samples
from validation.field_files import cgns, exodus, xdmf
from validation.inputs import hot_block, stereo_files
from validation.inputs.calibration_files import written_by_opencv
from validation.inputs.step_files import bored_block


@frozen
class Door:
    """One format and its reader.

    Attributes
    ----------
    name : str
        Row of the table.
    make : callable
        Writes the valid files into a folder.
    read : callable
        Reads them from there; InputError where they are damaged.
    damaged : tuple of str
        Patterns of the files that may be damaged.
    """

    name: str
    make: Callable[[Path], object]
    read: Callable[[Path], object]
    damaged: tuple[str, ...] = ("*",)


def _scene_of(name: str) -> Callable[[Path], object]:
    """Reads field and part and writes their scene."""

    def read(folder: Path) -> None:
        part = read_part(folder / name)
        air = HotAir(read_field(folder / "air.vtu"), layers=2)
        Scene(part, air, samples.camera()).save(folder / "out/scene.xml")

    return read


def _metrics(folder: Path) -> object:
    image = read_exr(folder / "out.exr")
    return image.camera, read_part_of(image, folder / "scene/part.ply")


def _read_journal(folder: Path) -> None:
    with open_journal(samples.work(folder)) as journal:
        for number in journal:
            journal.entry(number)
            journal.rows(number)


def _calibrated(name: str) -> Callable[[Path], object]:
    return lambda folder: read_calibration(folder / name).camera(pixel_size_mm=0.003)


def _cloud_door(ending: str) -> Door:
    name = f"cloud.{ending}"
    return Door(f"cloud, {ending}", samples.cloud(name), lambda folder: read_cloud(folder / name))


def _shift(name: str) -> Callable[[Path], object]:
    return lambda folder: read_measured_shift(folder / name)


def _field(name: str) -> Callable[[Path], object]:
    return lambda folder: read_field(folder / name)


def _scattered(name: str) -> Callable[[Path], object]:
    return lambda folder: read_field(folder / name, part=read_part(folder / "block.stl"))


DOORS = (
    Door(".vtu, raw", samples.xml("Appended", False, False), _field("air.vtu")),
    Door(".vtu, compressed", samples.xml("Appended", True, True), _field("air.vtu")),
    Door(".vtu, inline text", samples.xml("Ascii", False, False), _field("air.vtu")),
    Door(".vtu, inline base64", samples.xml("Binary", False, True), _field("air.vtu")),
    Door(".vtk, binary", samples.saved("air.vtk"), _field("air.vtk")),
    Door(".vtk, text", samples.saved("air.vtk", binary=False), _field("air.vtk")),
    Door(".vti", samples.image, _field("air.vti")),
    Door(".vtp", samples.surfaces, lambda folder: import_shells(folder / "shells.vtp")),
    Door(".vtm", samples.blocks, _field("air.vtm")),
    Door(".pvd", samples.series, _field("air.pvd")),
    Door("EnSight, text", samples.ensight_gold(False), _field("air.case")),
    Door("EnSight, binary", samples.ensight_gold(True), _field("air.case")),
    Door(
        "Exodus",
        lambda folder: exodus.write(folder / "air.e", hot_block.air(samples.CELLS)),
        _field("air.e"),
    ),
    Door(
        "CGNS",
        lambda folder: cgns.write(folder / "air.cgns", hot_block.air(samples.CELLS)),
        _field("air.cgns"),
    ),
    Door(
        "XDMF",
        lambda folder: xdmf.write(folder / "air.xdmf", hot_block.air(samples.CELLS)),
        _field("air.xdmf"),
    ),
    Door("OpenFOAM case", samples.case, _field("case")),
    Door("COMSOL text", samples.comsol_text("air.txt", " "), _scattered("air.txt"), ("air.txt",)),
    Door("COMSOL csv", samples.comsol_text("air.csv", ","), _scattered("air.csv"), ("air.csv",)),
    Door("part, STL", samples.mesh("part.stl"), _scene_of("part.stl"), ("part.stl",)),
    Door("part, PLY", samples.mesh("part.ply"), _scene_of("part.ply"), ("part.ply",)),
    Door("part, OBJ", samples.mesh("part.obj"), _scene_of("part.obj"), ("part.obj",)),
    Door(
        "part, STEP",
        lambda folder: (folder / "part.step").write_text(bored_block()),
        lambda folder: read_part(folder / "part.step"),
    ),
    Door(
        "field.npz",
        samples.scene,
        lambda folder: load_field_file(folder / "scene" / FIELD_FILE),
        (f"*/{FIELD_FILE}",),
    ),
    Door(
        "scene folder",
        samples.scene,
        lambda folder: load_scene(folder / "scene/scene.xml"),
        ("*/*.ply", "*/shells.json", "*/scene.xml"),
    ),
    Door(
        "scene folder, cells engine",
        samples.scene,
        lambda folder: load_scene(folder / "scene/scene.xml", engine="cells"),
        ("*/*.npz", "*/part.ply"),
    ),
    Door(
        "shells.json and shell PLY",
        samples.scene,
        lambda folder: load_shells(folder / "scene"),
        ("*/shells/*",),
    ),
    Door("AOV EXR", samples.image_of_pose, _metrics, ("out.exr",)),
    Door("lost rays", samples.rays, lambda folder: read_lost_rays(folder / "out.rays.json")),
    Door("calibration, OpenCV YAML", samples.calibration, _calibrated("camera.yaml")),
    Door("calibration, JSON", samples.plain_calibration, _calibrated("camera.json")),
    Door(
        "calibration, OpenCV XML",
        lambda folder: written_by_opencv(folder / "camera.xml"),
        _calibrated("camera.xml"),
    ),
    Door(
        "stereo calibration, OpenCV YAML",
        lambda folder: stereo_files.opencv(folder / "stereo.yaml"),
        lambda folder: read_stereo_calibration(folder / "stereo.yaml"),
    ),
    Door(
        "stereo calibration, MATLAB JSON",
        lambda folder: stereo_files.matlab(folder / "stereo.json", old=True),
        lambda folder: read_stereo_calibration(folder / "stereo.json"),
    ),
    *(
        Door(
            f"poses, {ending}",
            samples.poses(f"poses.{ending}"),
            lambda folder, ending=ending: read_poses(folder / f"poses.{ending}"),
        )
        for ending in ("npy", "csv", "json")
    ),
    Door(
        "sweep netCDF",
        samples.sweep,
        lambda folder: read_sweep(folder / "sweep.nc").load(),
        ("*.nc",),
    ),
    *(_cloud_door(ending) for ending in ("ply", "stl", "asc", "vtp", "e57", "pcd")),
    Door("measured shift, EXR", samples.shift_map, _shift("shift.exr")),
    Door("measured shift, npy", samples.shift_array, _shift("shift.npy")),
    Door("measured shift, csv", samples.markers, _shift("shift.csv")),
    *(
        Door(
            f"print, {name}",
            samples.printed,
            lambda folder, name=name: read_print(str(folder / name), 60.0),
            (name,),
        )
        for name in ("board.csv", "print.png")
    ),
    Door("journal", samples.journal, _read_journal, (journal_of(Path("sweep.nc")).name,)),
)


def files_of(door: Door, folder: Path) -> dict[str, bytes]:
    """Valid files of a door by their names in the folder, where they are written."""
    folder.mkdir()
    door.make(folder)
    return {
        file.relative_to(folder).as_posix(): file.read_bytes()
        for file in sorted(folder.rglob("*"))
        if file.is_file()
    }


def damageable(door: Door, names: Iterable[str]) -> list[str]:
    """Those of a door's files that may be damaged."""
    return [name for name in names if any(fnmatch(name, p) for p in door.damaged)]
