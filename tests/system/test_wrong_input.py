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
        ("--layers=0", "shells.layer_count", r"^0 .*\(--layers\)"),
        ("--layers=1000000000", "shells.layer_count", r"^1000000000 .* 10000 \(--layers\)"),
        ("--layers=many", "", "--layers.*many"),
        ("--ambient", "", "--ambient"),
        ("--ambient='20 degX'", "", r"20 degX.*\(--ambient\)"),
        ("--ambient=20", "", r"20 K or 20 degC.*\(--ambient\)"),
        ("--ambient='900 degC'", "air.out_of_range", r"1173.15 K .*\(--ambient\)\.$"),
        ("--ambient='300 degC'", "air.out_of_range", r"573.15 K .*\(--ambient\)\.$"),
        ("--array=U", "field.no_array", r"'U'.* T \(--array\)"),
        ("--quantity=density", "field.no_array", r"density.* T;.* --array.* --quantity"),
        ("--temperature-unit=F", "", "--temperature-unit.*degC"),
        ("--field-length-unit=parsec", "units.unknown_length", "parsec"),
        ("--field-transform='turn x 90'", "transform.unknown_step", "turn x 90"),
        ("--index-range=2.7e-4", "", r"2.7e-4.*OUTSIDE:INSIDE.*\(--index-range\)"),
        (
            "--index-range='1000 degC:20 degC'",
            "shells.no_hot_air",
            r"6.25835e-05.*0.0002718.*\(--ambient\)",
        ),
        ("--index-range=1.00027:1.00006", "", r'"1.00027".*not n - 1.*\(--index-range\)'),
        ("--index-range='-30 degC:10 degC'", "shells.none", "0.000327.* 0.000283"),
        ("--levels=3e-4,1e-4", "shells.levels_outside_air", r"0.0003,.*\(--levels\)"),
        ("--rule=inner", "", "--rule.*midpoint"),
        ("--min-size=-1", "shells.size_below_zero", r"-1.*\(--min-size\)"),
        ("--colour=red", "", "--colour"),
        ("surplus", "", "surplus"),
        ("--field-time=now", "", "--field-time.*snapshot"),
        ("--isosurfaces", "shells.no_triangles", "air.vtu"),
        ("--part .", "file.is_folder", r"input \. "),
    ],
    # A field that does not reach the part is refused, and the mistaken unit is named.
    "shells {field} -o out --part {part} --layers=2": [
        ("--length-unit=feet", "units.unknown_length", "feet"),
        ("--part-transform='rotate w 90'", "transform.unknown_step", "rotate w 90"),
        ("--expansion=14e-6/K", "part.no_hot_temperature", r"\(--hot-temperature\)"),
        (
            "--expansion=14 --hot-temperature='1000 K'",
            "part.unlikely_expansion",
            r"14.* 1000.*\(--expansion\)",
        ),
        ("--part-transform='translate 500 0 0'", "field.not_at_part", "translate -500"),
        ("--length-unit=m", "field.not_at_part", r" --length-unit mm"),
        ("--field-length-unit=m", "field.not_at_part", r" --field-length-unit mm"),
        ("--field-transform='translate 0 0 90'", "field.not_at_part", "translate 0 0 90"),
    ],
    "shells {shells} -o shells": [
        ("", "field.no_volume", "shells.vtm"),
        ("--isosurfaces --min-size=99", "shells.too_small", r" 99 mm.*\(--min-size\)"),
    ],
    "scene {field} {part} -o out/scene.xml --layers=2": [
        ("--part-transform='translate 500 0 0'", "field.not_at_part", "translate -500"),
        ("--focal-length=0", "camera.focal_length_not_positive", r" 0\..*\(--focal-length\)"),
        ("--sensor='-6 mm,5 mm'", "camera.sensor_not_positive", r"-6.* 5.*\(--sensor\)"),
        ("--sensor='6 mm'", "", r'"6 mm".*\(--sensor\)'),
        ("--resolution=100", "", r" 2 numbers.*\(--resolution\)"),
        ("--resolution=0,100", "camera.no_pixels", r"0 x 100 .*\(--resolution\)"),
        ("--focus=250:50", "camera.focus_empty", r"250.* 50.*\(--focus\)"),
        ("--origin=1,2", "", r" 3 numbers.*\(--origin\)"),
        ("--origin=0,0,3", "camera.inside", r"\[0.0, 0.0, 3.0\] mm .* in the part"),
        ("--origin=8,0,0", "camera.inside", r"\[8.0, 0.0, 0.0\] mm .* in the hot air"),
        ("--up=0,0,0", "", r"0,0,0.*\(--up\)"),
        ("--principal-point=1,2,3", "", r" 2 numbers.*\(--principal-point\)"),
        ("--scale=0", "camera.no_pixels", r" 0\..*\(--scale\)"),
        ("--normals=smooth", "", "--normals.*gradient"),
        # Negative values need no equals sign.
        ("--origin -.5,0,3", "camera.inside", r"\[-0.5, 0.0, 3.0\] mm .* in the part"),
        ("--ambient '-300 degC'", "", r"-300 degC.*\(--ambient\)"),
    ],
    "scene {field} {part} -o out/scene.xml --layers=2 --origin=60,-45,70": [
        ("--system=stereo", "", "^--system .*second device, and there is none"),
        (
            "--second-pixel-size='5 um'",
            "",
            "^--second-pixel-size .*second device, and there is none",
        ),
        ("--second=60,-45,70", "devices.one_place", r"\(--second\)"),
        ("--second=7,0,0", "camera.inside", r"second .* \[7.0, 0.0, 0.0\] mm .* in the hot air"),
        ("--second=1,0,0", "camera.inside", r"second .* \[1.0, 0.0, 0.0\] mm .* in the part"),
        ("--second=75,-20,70 --second-pixel-size='5 um'", "", "size .*--second-calibration"),
        ("--second-calibration=none.yaml", "", "none.yaml.*--second-pixel-size"),
    ],
    "scene": [
        ("{field} {part} -o out", "file.ending", r"out\.xml"),
        ("{field} {part} -o here", "file.is_folder", "here/scene.xml"),
        ("{field} {part} -o file/scene.xml", "file.no_folder", "file"),
        ("{field} . -o out/scene.xml", "file.is_folder", r"input \. "),
        ("{part} {field} -o out/scene.xml", "file.exchanged", "block.stl"),
        # Of two fields it is the part that is wrong, and not their order.
        ("{field} {field} -o out/scene.xml", "file.ending", "air.vtu"),
    ],
    "shells": [
        ("-o out", "", "needs FIELD"),
        ("air.vtu", "", "needs -o"),
        ("gone.vtu -o out", "file.missing", "gone.vtu"),
        (". -o out", "case.no_case", r"folder \. "),
        ("{field} -o file", "file.no_folder", "file"),
    ],
    "render": [
        ("", "", "needs SCENE"),
        ("gone.xml", "file.missing", "gone.xml"),
        # And not its output, which would lie beside it.
        ("no/scene.xml", "file.missing", r"no/scene\.xml; `iriftrace scene` writes one\.$"),
        ("''", "file.is_folder", r"input \. "),
        (".", "file.is_folder", r"input \. "),
        ("bytes.xml", "scene.other_file", "^bytes.xml"),
        ("{field}", "scene.other_file", "air.vtu"),
        ("{scene} -o here", "file.is_folder", "here/out.exr"),
        ("{scene} -o gone/out.exr", "file.no_folder", "gone"),
        ("{scene} -o scene.xml", "file.ending", r"scene\.exr"),
        (f"{{scene}} -o {'x' * 250}.exr", "file.unwritable", "x{250}.*too long"),
        ("{scene} -o out.exr --include=99", "", r"99 is .*5 index_mismatch.*\(--include\)"),
        ("{scene} -o out.exr --include=good", "", '--include.*"good"'),
        ("{scene} -o out.exr -D sclae=0.5", "scene.unknown_parameter", "sclae.*scale"),
        ("{scene} -o out.exr -D scale=big", "scene.unreadable", '"big"'),
        ("{scene} -o out.exr -D scale=-1", "scene.unreadable", "scale is -1"),
        ("{scene} -o out.exr -D normals=smooth", "scene.unreadable", "normals.*smooth.*gradient"),
        ("{scene} -o out.exr -D bending=facet", "scene.unreadable", "bending.*facet.*layers, sh"),
        ("{scene} -o out.exr -D scale", "", r'"scale".*name=value.*\(--define\)'),
        ("{scene} -o out.exr -D =0.5", "", r'"=0.5".*name=value.*\(--define\)'),
    ],
    "metrics": [
        ("gone.exr", "file.missing", "gone.exr"),
        # Not that its numbers would replace another file.
        ("words.nc", "file.damaged", "^words.nc .* AOV EXR"),
        ("{image} -o gone/out.json", "file.no_folder", "gone"),
        ("{image} -o out.exr", "file.ending", r"out\.json"),
        ("{image} -o o.json --part ball.stl", "file.changed", r"ball.stl.*\(--part\)"),
        ("{image} -o o.json --part gone.stl", "file.missing", r"gone.stl.*\(--part\)"),
    ],
    "demo": [
        ("-o file", "file.no_folder", "file"),
        ("-D sclae=0.5", "scene.unknown_parameter", "sclae.*scale"),
        ("--variant=fast", "variant.unusable", r"'fast'.*\(--variant\)"),
        ("--variant=scalar_rgb", "variant.unusable", r"'scalar_rgb'.*\(--variant\)"),
    ],
    "sing": [("", "", "sing")],
    "compare": [
        ("{image}", "", "needs MEASURED"),
        ("gone.exr m.csv", "file.missing", "gone.exr"),
        ("far.csv far.csv -o a.json", "file.damaged", "far.csv.* AOV EXR"),
    ],
    "compare {image} -o a.json": [
        ("gone.csv", "file.missing", "gone.csv"),
        ("here", "file.is_folder", "input here "),
        ("{scene}", "file.ending", r"scene\.xml .*\.csv"),
        ("words.csv", "file.damaged", "words.csv .*row of numbers"),
        ("far.csv", "shifts.outside_picture", "5 of 5 .* 120 x 100"),
        ("near.csv", "shifts.too_few", " 0 of 5 "),
        ("near.csv --include=3", "picture.no_displacement", r"status 3 .*\(--include\)"),
        ("small.npy", "shifts.other_size", "2 x 3 .* 120 x 100"),
        ("far.csv --positions=warm", "", "--positions.*cold"),
    ],
    "fit": [
        ("{scene} far.csv --view {scene} -o f/scene.xml", "", "--view takes 2 values, not 1"),
    ],
    "sweep": [
        ("-o a.nc", "", "needs SCENES"),
        ("{scene}", "", "-o|--output"),
        ("gone.xml -o a.nc", "file.missing", "gone.xml"),
        ("{scene} {scene} -o a.nc", "", "scene.xml is given twice"),
        ("{scene} -o a.csv", "file.ending", r"a\.nc"),
        ("{scene} -o words.nc --azimuth 0:90:2", "output.other_content", r"words.nc .*--output"),
        ("{scene} -o other.nc --azimuth 0:90:2", "output.other_content", r"other.nc .*--output"),
        ("{scene} -o j.nc --azimuth 0:90:2", "file.damaged", "j.nc.partial"),
    ],
    "sweep {scene} -o a.nc": [
        ("--azimuth north", "poses.range", "'north'"),
        ("--elevation 91", "poses.beyond_pole", r" 91 .*\(--elevation\)"),
        ("--focal-length '8 mm,ten'", "", r"ten.*\(--focal-length\)"),
        ("--focal-length 8mm,0.8cm", "", r"8mm,0.8cm.*twice.*\(--focal-length\)"),
        ("--stand-off 200K", "", r"200K.* mm .*\(--stand-off\)"),
        ("--stand-off 200 --semi-axes 90,90,90", "", "^--stand-off .*semi-axes"),
        ("--poses p.csv --stand-off 200", "", r"^--stand-off .* p\.csv"),
        ("--fibonacci 10 --elevation 0", "", "^--elevation .*spread evenly"),
        ("--convention ros", "", "^--convention .*list of poses"),
        ("--semi-axes 3,3,3", "poses.inside_part", r"172 of 172 .*\(--semi-axes\)"),
        ("--poses gone.csv", "file.missing", "gone.csv"),
        # As those of a file in metres that is read in millimetres.
        ("--poses inside.csv", "poses.inside_part", r"\(--length-unit\)"),
        ("--poses angles.csv", "file.dialect", "angles.csv .*'x,y,z,a,b,c'"),
        ("--include 99", "", r"99.*\(--include\)"),
        ("--export a.xlsx", "file.ending", r"a\.xlsx.*\.csv or"),
        ("--surface a.stl", "file.ending", r"a\.stl.*\.vtp or"),
        ("--workers 0", "workers.below_one", r"^0 .*\(--workers\)"),
    ],
    "twin": [("gone.csv far.csv", "file.missing", "gone.csv")],
    "ray": [
        ("gone.rays.json", "file.missing", "gone.rays.json"),
        ("far.csv", "rays.no_file", "far.csv"),
    ],
    "plan": [
        ("gone.nc", "file.missing", "gone.nc; .* `iriftrace sweep`"),
        ("words.nc", "file.damaged", r"words.nc .* netCDF .*\.nc .* `iriftrace sweep`"),
        ("here", "file.is_folder", "input here "),
        ("other.nc", "file.schema", "other.nc .*iriftrace.sweep/"),
        ("empty.nc", "sweep.no_pose", "run it again"),
    ],
    "plan {sweep}": [
        ("--statistic=mode", "", "--statistic.*mean"),
        ("--top=0", "ranking.below_one", r" 0 rows .*\(--top\)"),
        ("--convention=ros", "", "--convention .*--save"),
        ("--save=gone/poses.csv", "file.no_folder", "gone"),
        (
            "--views=2 --max-displacement='1e-9 um'",
            "views.nothing_seen",
            r" um .*\(--max-displacement\)",
        ),
        ("--views=2 --max-displacement=20", "", r'"20" .*without a unit.*\(--max-displacement\)'),
        (
            "--views=2 --max-incidence=100",
            "sweep.incidence_limit",
            r" 100 .* 0 to 90.*\(--max-incidence\)",
        ),
        ("--max-incidence=60", "", r"number of views.*\(--views\)"),
        ("--evaluations=60", "", "--evaluations .*--refine"),
        ("-o refined.json", "", "--output .*--refine"),
        ("--refine --evaluations=3", "evaluations.too_few", r"^3 .* 10 \(--evaluations\)"),
        ("--refine -o refined.txt", "file.ending", r"refined\.json"),
    ],
    "report {sweep}": [
        ("-o r.pdf", "file.ending", r"r\.html"),
        ("-o here", "file.is_folder", "here/report.html"),
        ("-o gone/report.html", "file.no_folder", "gone"),
    ],
    "report": [("gone.nc", "file.missing", "gone.nc; .* `iriftrace sweep`")],
    "plot": [
        ("gone.exr -o figures", "file.missing", "gone.exr"),
        ("words.exr -o figures", "file.damaged", "words.exr .* AOV EXR"),
        ("words.csv -o figures", "file.ending", r"words.csv .*\.nc .*\.exr"),
        ("{sweep} -o gone/figures", "file.no_folder", "gone"),
    ],
}
"""By command: what is wrong, the code of the library's error, and the value and right option.

The code is empty where the command line itself refuses its words.
"""

LINES = [
    (f"{command} {options}", code, words)
    for command, cases in WRONG.items()
    for options, code, words in cases
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


@pytest.mark.parametrize(("line", "code", "words"), LINES)
def test_lines(
    fails: Failing, names: dict[str, Path], tmp_path: Path, line: str, code: str, words: str
) -> None:
    """Found before the work begins, and no output replaces an input."""
    shutil.copytree(names["user"], tmp_path, dirs_exist_ok=True)
    refusal = fails(*shlex.split(line.format(**names)))
    assert re.search(words, refusal)
    if code:
        assert refusal.code == code


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
    refusal = fails("scene", hot.field, "part.ply", "-o", "scene.xml")
    assert "part.ply" in refusal
    assert refusal.code == "output.replaces"


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
    changed = fails("metrics", scene.with_suffix(".exr"))
    part.unlink()
    missing = fails("metrics", scene.with_suffix(".exr"))
    assert (changed.code, missing.code) == ("file.changed", "file.missing")
    assert "part.ply" in changed
    assert "part.ply" in missing


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
