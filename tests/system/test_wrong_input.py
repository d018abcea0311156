"""Wrong input: exit code 2, one readable message, nothing half written, no traceback."""

import os
import re
import shlex
import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh
import xarray as xr
from failing import Failing

from iriftrace.cli import main
from validation.inputs import hot_block
from validation.inputs.hot_block import HotBlock

WRONG = {
    "shells {field} -o shells": [
        ("--layers=0", "0 layers"),
        ("--layers=1000000000", "at most 10000"),
        ("--layers=many", "many"),
        ("--ambient", "ambient"),
        ("--ambient='20 degX'", "20 degX"),
        ("--ambient=20", "20 K or 20 degC"),
        ("--ambient='900 degC'", "900|1173"),
        ("--ambient='300 degC'", r"far from the part, which is not heated \(--ambient\)\.$"),
        ("--array=U", "'U'.*T"),
        ("--quantity=density", "density"),
        ("--temperature-unit=F", "degC"),
        ("--field-length-unit=parsec", "parsec"),
        ("--field-transform='turn x 90'", "turn x 90"),
        ("--index-range=2.7e-4", "OUTSIDE:INSIDE"),
        ("--index-range='1000 degC:20 degC'", "ambient"),
        ("--index-range=1.00027:1.00006", '"1.00027".*not n - 1'),
        ("--index-range='-30 degC:10 degC'", "no surface"),
        ("--levels=3e-4,1e-4", "0.0003"),
        ("--rule=inner", "midpoint"),
        ("--min-size=-1", "-1"),
        ("--colour=red", "colour"),
        ("surplus", "surplus"),
        ("--field-time=now", "snapshot"),
        ("--isosurfaces", "triangles"),
        ("--part .", "folder"),
    ],
    # A field that does not reach the part is refused, and the mistaken unit is named.
    "shells {field} -o out --part {part} --layers=2": [
        ("--length-unit=feet", "feet"),
        ("--part-transform='rotate w 90'", "rotate w 90"),
        ("--expansion=14e-6/K", "hot temperature"),
        ("--expansion=14 --hot-temperature='1000 K'", "14"),
        ("--part-transform='translate 500 0 0'", "translate -500"),
        ("--length-unit=m", r"length unit mm.*\(--length-unit\)"),
        ("--field-length-unit=m", r"length unit mm.*\(--field-length-unit\)"),
        ("--field-transform='translate 0 0 90'", "does not reach"),
    ],
    "shells {shells} -o shells": [
        ("", "volume"),
        ("--isosurfaces --min-size=99", "smaller than 99 mm"),
    ],
    "scene {field} {part} -o out/scene.xml --layers=2": [
        ("--part-transform='translate 500 0 0'", "translate -500"),
        ("--focal-length=0", "Focal length is 0"),
        ("--sensor='-6 mm,5 mm'", "-6"),
        ("--sensor='6 mm'", "width and height"),
        ("--resolution=100", "2 numbers"),
        ("--resolution=0,100", "0 x 100"),
        ("--focus=250:50", "250"),
        ("--origin=1,2", "3 numbers"),
        ("--origin=0,0,3", "part"),
        ("--origin=8,0,0", "hot air"),
        ("--up=0,0,0", "up"),
        ("--principal-point=1,2,3", "2 numbers"),
        ("--scale=0", "cale is 0"),
        ("--normals=smooth", "gradient"),
        # Negative values need no equals sign.
        ("--origin -.5,0,3", "stands in the part"),
        ("--ambient '-300 degC'", "-300 degC"),
    ],
    "scene {field} {part} -o out/scene.xml --layers=2 --origin=60,-45,70": [
        ("--system=stereo", "`system` is of a second device, and there is none"),
        ("--second-pixel-size='5 um'", "`second_pixel_size` is of a second device"),
        ("--second=60,-45,70", "Both devices stand at one place"),
        ("--second=7,0,0", r"The second device at \[7.0, 0.0, 0.0\] mm stands in the hot air"),
        ("--second=1,0,0", r"The second device at \[1.0, 0.0, 0.0\] mm stands in the part"),
        (
            "--second=75,-20,70 --second-pixel-size='5 um'",
            "belongs to a calibration of the second device",
        ),
        ("--second-calibration=none.yaml", "--second-pixel-size"),
    ],
    "scene": [
        ("{field} {part} -o out", r"\.xml"),
        ("{field} {part} -o here", "here is a folder"),
        ("{field} {part} -o file/scene.xml", "file is a file"),
        ("{field} . -o out/scene.xml", "folder"),
        ("{part} {field} -o out/scene.xml", "stl is not a field .*; field and part may be exch"),
        # Of two fields it is the part that is wrong, and not their order.
        ("{field} {field} -o out/scene.xml", "^(?!.*exchanged)"),
    ],
    "shells": [
        ("-o out", "needs FIELD"),
        ("air.vtu", "needs -o"),
        ("gone.vtu -o out", "no file gone.vtu"),
        (". -o out", "folder"),
        ("{field} -o file", "file is a file"),
    ],
    "render": [
        ("", "needs SCENE"),
        ("gone.xml", "gone.xml"),
        # And not its output, which would lie beside it.
        ("no/scene.xml", r"^There is no scene file no/scene\.xml; `iriftrace scene` writes one\.$"),
        ("''", "folder"),
        (".", "folder"),
        ("bytes.xml", "bytes.xml is not a Mitsuba scene"),
        ("{field}", "is not a Mitsuba scene"),
        ("{scene} -o here", "here is a folder"),
        ("{scene} -o gone/out.exr", "gone does not exist"),
        ("{scene} -o scene.xml", r"\.exr"),
        (f"{{scene}} -o {'x' * 250}.exr", "too long"),
        ("{scene} -o out.exr --include=99", "99.*5 index_mismatch"),
        ("{scene} -o out.exr --include=good", '"good"'),
        ("{scene} -o out.exr -D sclae=0.5", "sclae.*scale"),
        ("{scene} -o out.exr -D scale=big", "big"),
        ("{scene} -o out.exr -D scale=-1", "scale"),
        ("{scene} -o out.exr -D normals=smooth", "smooth"),
        ("{scene} -o out.exr -D bending=facet", "bending.*facet.*layers, shells"),
        ("{scene} -o out.exr -D scale", "name=value"),
        ("{scene} -o out.exr -D =0.5", "name=value"),
    ],
    "metrics": [
        ("gone.exr", "gone.exr"),
        # Not that its numbers would replace another file.
        ("words.nc", "words.nc .*give the AOV EXR"),
        ("{image} -o gone/out.json", "gone does not exist"),
        ("{image} -o out.exr", r"\.json"),
        ("{image} -o o.json --part ball.stl", "SHA-256 differs"),
        ("{image} -o o.json --part gone.stl", "--part"),
    ],
    "demo": [
        ("-o file", "file is a file"),
        ("-D sclae=0.5", "sclae.*scale"),
        ("--variant=fast", "fast"),
        ("--variant=scalar_rgb", "scalar"),
    ],
    "sing": [("", "sing")],
    "compare": [
        ("{image}", "needs MEASURED"),
        ("gone.exr m.csv", "gone.exr"),
        ("far.csv far.csv -o a.json", "not an OpenEXR file"),
    ],
    "compare {image} -o a.json": [
        ("gone.csv", "gone.csv"),
        ("here", "here is a folder"),
        ("{scene}", "not a file of measured shifts"),
        ("words.csv", "no row of numbers"),
        ("far.csv", "5 of 5 places.*outside the rendering of 120 x 100"),
        ("near.csv", "Only 0 of 5 measured"),
        ("near.csv --include=3", "status 3"),
        ("small.npy", "2 x 3 pixels"),
        ("far.csv --positions=warm", "cold"),
    ],
    "fit": [
        ("{scene} far.csv --view {scene} -o f/scene.xml", "--view takes 2 values, not 1"),
    ],
    "sweep": [
        ("-o a.nc", "needs SCENES"),
        ("{scene}", "-o|--output"),
        ("gone.xml -o a.nc", "gone.xml"),
        ("{scene} {scene} -o a.nc", "given twice"),
        ("{scene} -o a.csv", r"\.nc"),
        ("{scene} -o words.nc --azimuth 0:90:2", "words.nc already exists and is not a sweep"),
        ("{scene} -o other.nc --azimuth 0:90:2", "other.nc already exists and is not a sweep"),
        ("{scene} -o j.nc --azimuth 0:90:2", "j.nc.partial"),
    ],
    "sweep {scene} -o a.nc": [
        ("--azimuth north", "north"),
        ("--elevation 91", "91"),
        ("--focal-length '8 mm,ten'", "ten.*--focal-length"),
        ("--focal-length 8mm,0.8cm", "twice"),
        ("--stand-off 200K", "200K"),
        ("--stand-off 200 --semi-axes 90,90,90", "--stand-off"),
        ("--poses p.csv --stand-off 200", "p.csv"),
        ("--fibonacci 10 --elevation 0", "--elevation"),
        ("--convention ros", "list of poses.*--convention"),
        ("--semi-axes 3,3,3", "inside the part"),
        ("--poses gone.csv", "gone.csv"),
        # As those of a file in metres that is read in millimetres.
        ("--poses inside.csv", "No pose stands outside"),
        ("--poses angles.csv", "angles.csv has the columns 'x,y,z,a,b,c'"),
        ("--include 99", "99"),
        ("--export a.xlsx", r"a\.xlsx.*\.csv or"),
        ("--surface a.stl", r"a\.stl.*\.vtp or"),
        ("--workers 0", "0 workers"),
    ],
    "plan": [
        ("gone.nc", "no file gone.nc; .* `iriftrace sweep`"),
        ("words.nc", r"no netCDF file\); give the \.nc"),
        ("here", "folder"),
        ("other.nc", "run the sweep again"),
        ("empty.nc", "no pose"),
    ],
    "plan {sweep}": [
        ("--statistic=mode", "mode"),
        ("--top=0", "0 rows"),
        ("--convention=ros", "--convention is given without --save-poses"),
        ("--save-poses=gone/poses.csv", "does not exist"),
        ("--views=2 --max-displacement='1e-9 um'", "No pose sees a face of part within"),
        ("--views=2 --max-displacement=20", '"20" is a length without a unit'),
        ("--views=2 --max-incidence=100", "0 to 90"),
        ("--max-incidence=60", "number of views is 0"),
        ("--evaluations=60", "--evaluations is given without --refine"),
        ("-o refined.json", "--output is given without --refine"),
        ("--refine --evaluations=3", "3 evaluations are too few"),
        ("--refine -o refined.txt", "must end in .json"),
    ],
    "report {sweep}": [
        ("-o r.pdf", "must end in .html"),
        ("-o here", "is a folder"),
        ("-o gone/report.html", "does not exist"),
    ],
    "report": [("gone.nc", "no file gone.nc; .* `iriftrace sweep`")],
    "plot": [
        ("gone.exr -o figures", "gone.exr"),
        ("words.exr -o figures", "not an OpenEXR"),
        ("words.csv -o figures", "neither .nc nor .exr"),
        ("{sweep} -o gone/figures", "does not exist"),
    ],
}
LINES = [
    (f"{command} {options}", words) for command, cases in WRONG.items() for options, words in cases
]


@pytest.fixture(scope="module")
def names(hot: HotBlock, sweep: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Files by the names that the lines have for them, and a folder that no line may change."""
    user = tmp_path_factory.mktemp("user")
    (user / "here").mkdir()
    for name, text in {
        "file": "",
        "scene.xml": "",
        "words.csv": "these are words\n",
        "words.nc": "not ours\n",
        "words.json": "{}\n",
        "words.exr": "no EXR",
        "j.nc.partial": "{}\n",
        "far.csv": "u,v,du,dv\n" + "9000,1,0,0\n" * 5,
        "near.csv": "u,v,du,dv\n" + "1,1,0,0\n" * 5,
        "angles.csv": "x,y,z,a,b,c\n0,0,90,0,0,180\n",
        "inside.csv": "x,y,z,target_x,target_y,target_z\n" + "0.006,0,0.004,0,0,0\n" * 2,
    }.items():
        (user / name).write_text(text)
    (user / "bytes.xml").write_bytes(bytes(range(256)))
    np.save(user / "small.npy", np.zeros((3, 2, 2)))
    xr.Dataset({"a": ("x", [1.0])}).to_netcdf(user / "other.nc", engine="h5netcdf")
    with xr.open_dataset(sweep, engine="h5netcdf") as data:
        data[["matrix"]].isel(pose=[]).to_netcdf(user / "empty.nc", engine="h5netcdf")
    trimesh.creation.icosphere().export(user / "ball.stl")
    files = {name: getattr(hot, name) for name in ("field", "part", "scene", "image")}
    shells = hot.scene.parent / "shells" / "shells.vtm"
    return {**files, "sweep": sweep, "shells": shells, "user": user}


@pytest.mark.parametrize(("line", "words"), LINES)
def test_lines(
    fails: Failing, names: dict[str, Path], tmp_path: Path, line: str, words: str
) -> None:
    """Found before the work begins, and no output replaces an input."""
    shutil.copytree(names["user"], tmp_path, dirs_exist_ok=True)
    assert re.search(words, fails(*shlex.split(line.format(**names))))


@pytest.mark.parametrize("command", ["shells", "scene", "render", "metrics", "demo"])
def test_a_folder_that_may_not_be_written(
    fails: Failing, hot: HotBlock, tmp_path: Path, command: str
) -> None:
    closed = tmp_path / "closed"
    closed.mkdir(mode=0o500)
    if os.access(closed, os.W_OK):  # whoever may do everything cannot write here
        closed = Path("/proc")
    arguments = {
        "shells": (hot.field, "-o", closed / "shells", "--layers=1"),
        "scene": (hot.field, hot.part, "-o", closed / "scene.xml", "--layers=1"),
        "render": (hot.scene, "-o", closed / "out.exr"),
        "metrics": (hot.image, "-o", closed / "out.json"),
        "demo": ("-o", closed / "demo", "-D", "scale=0.01"),
    }[command]
    assert str(closed) in fails(command, *arguments)


def test_the_scene_does_not_replace_the_part(fails: Failing, hot: HotBlock, tmp_path: Path) -> None:
    """Written back in float32 and moved, it would be another part at the next run."""
    trimesh.load(hot.part).export(tmp_path / "part.ply")
    assert "would replace" in fails("scene", hot.field, "part.ply", "-o", "scene.xml")


def test_a_part_that_is_not_closed_is_legitimate(
    hot: HotBlock, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A scanned surface: one warning says which numbers suffer, and the work goes on."""
    mesh = hot_block.block().subdivide().subdivide().subdivide()
    mesh.update_faces(np.arange(len(mesh.faces)) > 0)
    mesh.export(tmp_path / "open.stl")
    scene = tmp_path / "scene" / "scene.xml"
    arguments = ["scene", str(hot.field), str(tmp_path / "open.stl"), "-o", str(scene)]
    for command in ([*arguments, "--layers=2", *hot_block.CAMERA], ["render", str(scene)]):
        capsys.readouterr()
        assert main(command) == 0
        said = capsys.readouterr().err
        assert said.count("warning:") == 1
        assert "is not closed (3 open edges): coverage" in said
    assert main(["metrics", str(scene.with_suffix(".exr"))]) == 0


def test_a_part_that_was_changed_since(fails: Failing, scene: Path) -> None:
    """The numbers of its faces would not fit any more."""
    assert main(["render", str(scene), "--no-figures"]) == 0
    part = scene.parent / "part.ply"
    part.write_bytes(part.read_bytes() + b"\n")
    assert "SHA-256 differs" in fails("metrics", scene.with_suffix(".exr"))
    part.unlink()
    assert "is missing" in fails("metrics", scene.with_suffix(".exr"))


@pytest.mark.parametrize(
    "error", [MemoryError(), ImportError("libvtk.so: failed to map segment from shared object")]
)
@pytest.mark.parametrize(
    ("words", "advice"),
    [
        ("correct cloud.ply scene.xml", "a cloud of fewer points, or the cloud in pieces"),
        ("render scene.xml -o out.exr", "fewer pixels, such as -D scale=0.25"),
        ("field synthetic part.ply -o out.vtu", "fewer or larger cells"),
        ("scene field.vtu part.ply -o scene.xml", "a field of fewer cells"),
        ("plan sweep.nc", "smaller inputs"),
    ],
)
def test_without_memory_the_advice_is_for_the_command(
    words: str,
    advice: str,
    error: Exception,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Also where it is not enough to load a library."""

    def too_large(*paths: Path) -> None:
        raise error

    monkeypatch.setattr("iriftrace.cli.checks.inputs", too_large)
    assert main(words.split()) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert f"more memory than the machine has; give it {advice}" in said
