"""The commands ``iriftrace plot``, ``view`` and ``report``: pictures of results."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

from iriftrace.cli import checks
from iriftrace.cli.console import notes, say, working
from iriftrace.cli.options import LightOf, Output, Whole
from iriftrace.cli.plan import Ranking, Several
from iriftrace.cli.trace_options import check_light
from iriftrace.core.errors import InputError, SetupError, refuse_given
from iriftrace.core.files import FileOrigin
from iriftrace.image.displacement import NORM, Component
from iriftrace.io.reading import ReadPart
from iriftrace.planning.criteria import SHOWN, STANDARD_CRITERIA

if TYPE_CHECKING:
    import pyvista as pv

    from iriftrace.core.plain import JsonObject

_MESHES = (".ply", ".stl", ".obj", ".glb", ".gltf", ".off")
FRAME_PX = 440
"""Height of the picture in a report that turns."""

IMAGE_PX = (1200, 900)
"""Size for which the image is drawn that is printed; less than its own, so its text is larger."""

_OTHER_CLOUDS = (".asc", ".xyz", ".pts", ".pcd", ".e57")


def plot(
    file: Path,
    *,
    output: Output = Path("figures"),
    ranking: Ranking = STANDARD_CRITERIA,
    component: Component = NORM,
    wavelength: LightOf = None,
) -> None:
    """Draw a sweep or one pose.

    For a sweep: the poses in space, coloured by each metric; maps over azimuth and elevation;
    histograms; rays of each pose; the Pareto front; the views of smallest and largest
    displacement; the faces of the part, coloured by how well they are seen. For a pose: the
    displacement picture, and for an ensemble also that of the scatter.

    Example: ``iriftrace plot sweep.nc -o figures``

    Parameters
    ----------
    file
        A sweep (.nc) that ``iriftrace sweep`` wrote; or an AOV image (.exr), to which the options
        for the ranking do not apply.
    output
        Folder for the pictures (PNG, and PDF for vector graphics).
    component
        For a pose, draw the length of the displacement, or a signed component in colours about 0:
        along the line of sight (positive away from the camera), or across it to the right or down
        in the picture.
    """
    from iriftrace.figures.result import plot as draw
    from iriftrace.figures.result import read_result
    from iriftrace.image.aov_image import AovImage

    checks.inputs(file)
    checks.parent(output)
    checks.folder(output)
    if output.suffix.lower() in (".png", ".pdf", ".jpg", ".jpeg", ".svg"):
        raise InputError(
            f"The output {output} is the folder of the pictures, but has the name of one; name a "
            "folder, such as figures.",
            code="file.picture_as_folder",
        )
    result = read_result(file)
    header = result.header if isinstance(result, AovImage) else result.attrs
    check_light(wavelength, header, file)
    new = not output.exists()
    try:
        output.mkdir(exist_ok=True)
        with working("Drawing"):
            plots = draw(result, criteria=ranking, name=file.stem, component=component)
            pictures = plots.save(output)
    except BaseException:
        if new:
            shutil.rmtree(output, ignore_errors=True)
        raise
    _print_missing(plots.missing)
    say(f"Pictures in {output}: {', '.join(path.name for path in pictures)}")


def view(file: Path, *, output: Output | None = None, length_unit: str | None = None) -> None:
    """Show a scene, a result, a field or a part in a window, on a page or as an image.

    Example: ``iriftrace view scene.xml -o view.html``

    Parameters
    ----------
    file
        A scene (.xml) with part, shells cut open, devices and rays; a pose (.exr) with its hits,
        coloured by displacement; a sweep (.nc) with its cameras, coloured by score; a cloud (.vtp,
        .ply) that ``measure``, ``correct``, ``fit`` or ``render --surface`` wrote, coloured by the
        error; the derivatives (.vtu) that ``sensitivity`` wrote; a field (.vtu ...), cut open; a
        part (.ply .stl .obj .glb) with its regions.
    output
        Write a page (.html) that any browser turns offline, or an image (.png); by default a window
        opens.
    length_unit
        Unit of a part's coordinates; by default the unit that the file states (glTF: m), else mm.
    """
    from iriftrace.figures.window import view as show

    checks.output(output, "view.html", ".png")
    checks.inputs(file)
    with working("Reading"):
        shown, numbers = read_shown(file, length_unit)
    with working("Drawing"):
        show(shown, output, numbers=numbers, title=f"iriftrace: {file}")
    if output is not None:
        say(f"{'Image' if output.suffix.lower() == '.png' else 'Page'}: {output}")


def read_shown(file: Path, length_unit: str | None = None) -> tuple[Any, JsonObject | None]:
    """What a file holds, and the numbers next to it if it is a cloud."""
    if not file.exists():
        raise InputError(f"There is no file {file}; give an existing one.", code="file.missing")
    suffix = file.suffix.lower()
    if length_unit is not None and suffix not in _MESHES:
        raise InputError(
            f"A length unit is for the mesh of a part, and {file} is not one "
            f"({', '.join(_MESHES)}); leave it out.",
            code="file.no_mesh",
            argument="length_unit",
        )
    if suffix in _OTHER_CLOUDS:
        raise InputError(
            f"{file} is a cloud; one is shown from a .vtp or .ply: write it as that.",
            code="file.ending",
        )
    cloud = _cloud(file) if suffix in (".vtp", ".ply") else None
    if cloud is not None:
        return cloud, _numbers_beside(file)
    if suffix in _MESHES:
        from iriftrace.io.part_files import read_part

        return read_part(file, ReadPart(length_unit=length_unit)), None
    if suffix == ".xml":
        from iriftrace.tracing.load import load_scene

        return load_scene(file), None
    if suffix in (".exr", ".nc"):
        from iriftrace.figures.result import read_result

        return read_result(file), None
    numbers = _numbers_beside(file)
    if str((numbers or {}).get("schema")).startswith("iriftrace.sensitivity/"):
        import pyvista as pv

        from iriftrace.io.vtk_check import read_file

        grid = pv.wrap(read_file(file))
        points = pv.PolyData(grid.points)
        points.point_data.update(grid.point_data)
        return points, numbers
    from iriftrace.io.field import read_field

    return read_field(file), None


def _cloud(file: Path) -> pv.PolyData | None:
    """The points of a file with their columns; None for a mesh in a PLY file."""
    import pyvista as pv

    if file.suffix.lower() == ".vtp":
        from iriftrace.io.vtk_check import read_file

        return pv.wrap(read_file(file))
    from iriftrace.io.ply import read_whole_ply

    mesh = read_whole_ply(file, "write it again")
    if len(mesh.faces):
        return None
    points = pv.PolyData(mesh.vertices)
    for name, values in mesh.vertex_columns.items():
        points.point_data[name] = values
    return points


def _numbers_beside(cloud: Path) -> JsonObject | None:
    """JSON values that lie next to a cloud; None if they do not exist."""
    try:
        values = json.loads(cloud.with_suffix(".json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return values if isinstance(values, dict) else None


def report(
    file: Path,
    *,
    output: Output = Path("report.html"),
    ranking: Ranking = STANDARD_CRITERIA,
    top: Whole = SHOWN,
    wavelength: LightOf = None,
    views: Several = None,
    tolerance: list[str] | None = None,
) -> None:
    """Write a sweep, a measurement or a correction as one HTML page that works offline.

    Example: ``iriftrace report sweep.nc -o report.html``

    Parameters
    ----------
    file
        A sweep (.nc); or a cloud (or its .json) that ``iriftrace measure`` or ``correct`` wrote,
        to which the options for the ranking do not apply.
    output
        The HTML file.
    top
        Rows of the ranking.
    tolerance
        Tolerance of a diameter of a correction, "cylinder:bore=20.22 -0.02 +0.02 mm", by which it
        is accepted or rejected without correcting again; repeatable.
    """
    checks.output(output, "report.html")
    checks.inputs(file)
    if file.suffix.lower() == ".nc":
        reason = f"is for a correction, and {file} is a sweep (.nc); leave it out."
        refuse_given({"tolerance": tolerance}, reason, "options.not_together")
        from iriftrace.figures.report import write_report
        from iriftrace.planning.summary import summarise
        from iriftrace.sweep.store import read_sweep

        dataset = read_sweep(file)
        check_light(wavelength, dataset.attrs, file)
        summary = summarise(dataset, ranking)
        with working("Writing the report"):
            missing = write_report(output, dataset, summary, top=top, views=views)
    elif (top, wavelength, views) == (SHOWN, None, None):
        from iriftrace.figures.scan_report import write_scan_report

        numbers, values = _numbers(file)
        values = _decided(numbers, values, tolerance)
        picture = numbers.with_suffix(".png")
        png = picture.read_bytes() if picture.is_file() else b""
        with working("Writing the report"):
            space, turns, missing = _in_space(file)
            write_scan_report(output, values, FileOrigin.of(numbers), png, space, turns)
        if not png:
            missing += (f"There is no picture {picture}: compute the result with figures.",)
    else:
        raise InputError(
            f"Rows of a ranking, views and light are for a sweep (.nc), and {file} is none; "
            "leave them out.",
            code="options.of_a_sweep",
        )
    _print_missing(missing)
    say(f"Report in {output}")


def _in_space(cloud: Path) -> tuple[bytes, str, tuple[str, ...]]:
    """A cloud in space: a PNG, and HTML in which it turns; if there is none, why."""
    from tempfile import TemporaryDirectory

    from iriftrace.figures.page import frame
    from iriftrace.figures.pictures import picture_of
    from iriftrace.figures.window import write_image

    if cloud.suffix.lower() not in (".vtp", ".ply") or not cloud.is_file():
        return b"", "", ("Without a cloud in a .vtp or .ply there is no picture in space.",)
    with TemporaryDirectory() as folder:
        image = Path(folder) / "space.png"
        try:
            picture = picture_of(*read_shown(cloud))
            write_image(image, picture, IMAGE_PX)
            return image.read_bytes(), frame(picture, FRAME_PX), ()
        except (InputError, SetupError) as error:
            return b"", "", (f"There is no picture in space: {error}",)


def _decided(file: Path, values: JsonObject, tolerance: list[str] | None) -> JsonObject:
    """The values with the verdicts on tolerances, if there are any, which are printed."""
    from iriftrace.figures.describe_scan import describe, sentences
    from iriftrace.measuring.two_devices.correction import SCHEMA
    from iriftrace.measuring.two_devices.decided import decided
    from iriftrace.measuring.uncertainty.tolerances import tolerances_of

    if tolerance is None:
        return values
    if values["schema"] != SCHEMA:
        say(f"No verdict: {file} holds sizes of a simulated measurement.")
        return values
    stated = tolerances_of(tolerance)
    try:
        values = decided(values, stated)
        verdicts = sentences(describe(values), "verdict")
    except InputError:
        raise
    except (LookupError, TypeError, ValueError) as error:
        raise InputError(
            f"{file} is damaged ({error!r}); correct the cloud again.", code="file.damaged"
        ) from error
    for text in verdicts:
        say(text)
    return values


def _numbers(path: Path) -> tuple[Path, JsonObject]:
    """The JSON file of a scan or correction, which may be given by its cloud, and its values."""
    from iriftrace.figures.describe_scan import TRUE_CLOUDS

    file = path if path.suffix.lower() == ".json" else path.with_suffix(".json")
    if not file.is_file():
        raise InputError(
            f"The file {file} does not exist; give a sweep (.nc), or what iriftrace measure or "
            "correct wrote.",
            code="file.missing",
        )
    try:
        values = json.loads(file.read_text(encoding="utf-8"))
        schema = str(values["schema"])
    except (OSError, ValueError, LookupError, TypeError):
        schema = ""
    kinds = {known.partition("/")[0]: known for known in TRUE_CLOUDS}
    current = kinds.get(schema.partition("/")[0])
    if current is not None and schema != current:
        raise InputError(
            f"{file} has schema {schema!r} instead of {current!r}, so it was written by another "
            "version of iriftrace; measure or correct again with this one.",
            code="file.schema",
        )
    if current is None:
        raise InputError(
            f"{file} holds no numbers of iriftrace measure or correct for a report; "
            "give a sweep (.nc), or a cloud that lies next to its .json.",
            code="report.no_numbers",
        )
    return file, values


def _print_missing(sentences: tuple[str, ...]) -> None:
    for text in sentences:
        notes.print(f"note: {text}", markup=False, soft_wrap=True)
