"""The figures of a scan and a correction, what colours and bins mean, and their reports."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
import trimesh
from attrs import evolve
from browser import browser
from scipy.spatial import cKDTree

from iriftrace.camera.camera import Camera
from iriftrace.camera.pose import look_at
from iriftrace.core.files import FileOrigin
from iriftrace.core.plain import JsonObject
from iriftrace.figures.page import frame
from iriftrace.figures.pictures import picture_of
from iriftrace.figures.scan import correction_figure, scan_figure
from iriftrace.figures.scan_report import scan_page, write_scan_report
from iriftrace.figures.style import figure_bytes
from iriftrace.measuring.two_devices.correct import correct
from iriftrace.measuring.two_devices.correction import Correction
from iriftrace.measuring.two_devices.correction_status import CorrectionStatus
from iriftrace.measuring.two_devices.measure import measure
from iriftrace.measuring.uncertainty.decision import Tolerance
from iriftrace.measuring.uncertainty.inputs import Inputs
from iriftrace.part.growth import Growth
from iriftrace.part.part import part_of_mesh
from iriftrace.part.standards import cylinder
from iriftrace.scenes import folder_of
from iriftrace.tracing.load import load_scene
from validation.oracles.html_page import read_page

CAMERA = Camera(
    focal_length_mm=10.0,
    sensor_mm=(6.7, 5.6),
    resolution=(612, 512),
    matrix=look_at((0.0, -300.0, 0.0), (0.0, 0.0, 0.0)),
)


def setting_of(values: JsonObject) -> dict[str, str]:
    """The rows of the report that say what the numbers come from."""
    (blocks,) = (each["blocks"] for each in scan_page(values).sections if each["name"] == "setting")
    return dict(blocks[0]["content"])


def report_of(numbers: Path) -> Path:
    """The written report of a result's JSON file."""
    page = numbers.with_suffix(".html")
    write_scan_report(page, json.loads(numbers.read_text()), FileOrigin.of(numbers))
    return page


@pytest.mark.parametrize("long", [True, False])
def test_before_by_air_and_after_have_one_scale_and_add_up(long: bool) -> None:
    """A part 3 um too large through air that takes 1 to 2 um; points lie beyond one end.

    The camera looks at a wide picture or, turned, at a high one.
    """
    part = cylinder()
    count = 1000
    rng = np.random.default_rng(2)
    face = np.full(count, int(np.argmin(part.surface.normals[:, 1])))
    normal = part.surface.normals[face]
    air = -1e-3 * np.linspace(1.0, 2.0, count)
    air[:5] = -0.1
    on_part = np.column_stack((rng.uniform(-20, 20, count), np.zeros(count), np.zeros(count)))
    on_part += (part.face_offsets[face] / normal[:, 1])[:, None] * (0.0, 1.0, 0.0)
    on_part += 0.003 * normal
    found = Correction(
        measured=on_part + air[:, None] * normal,
        error=air[:, None] * normal,
        status=np.zeros(count, dtype=np.int64),
        face=face,
        face_normals=part.surface.normals,
        system="fringe",
        provenance={"field": {"source": "a solver"}},
    )
    up = None if long else (1.0, 0.0, 0.0)
    camera = CAMERA if long else CAMERA.at(look_at((0.0, -300.0, 0.0), (0.0, 0.0, 0.0), up))
    (body,) = correction_figure(found, part, camera).subfigs
    names = ["as measured", "by hot air", "corrected"]
    titled = {axes.get_title(): axes for axes in body.axes}
    maps = [titled[name] for name in names]
    (histogram,) = (axes for axes in body.axes if axes.get_legend())
    bar = body.axes[-1]
    measured, by_air, corrected = (axes.collections[0] for axes in maps)
    assert by_air.get_array().max() < 0.0
    np.testing.assert_allclose(corrected.get_array(), 3.0, rtol=1e-6)
    np.testing.assert_allclose(measured.get_array(), by_air.get_array() + 3.0, rtol=1e-6)
    limits = {(drawn.norm.vmin, drawn.norm.vmax) for drawn in (measured, by_air, corrected)}
    assert len(limits) == 1
    assert bar.get_xlabel() == "deviation along the normal (µm)"
    assert "beyond" in histogram.get_xlabel()
    assert [text.get_text() for text in histogram.get_legend().get_texts()] == names
    # No room is wasted: wide maps are stacked, high ones lie in a row.
    figure = body.figure
    figure.draw_without_rendering()
    boxes = [axes.get_window_extent() for axes in maps]
    same = [box.x0 for box in boxes] if long else [box.y0 for box in boxes]
    np.testing.assert_allclose(same, same[0], atol=1.0)


def test_a_laser_line_is_drawn_on_the_part_as_measured_and_corrected(
    variant: str, tmp_path: Path
) -> None:
    """In the same axes; the report says why there are no sizes, and no area of so few points."""
    file = folder_of("fringe_cylinder") / "scene.xml"
    scene = load_scene(file, {"scale": "0.25"}, variant=variant)
    scan = measure(scene, system="laser")
    found = correct(scan.points, scene, system="laser")
    hidden = np.arange(len(scan.points)) < 9
    found = evolve(found, status=np.where(hidden, CorrectionStatus.HIDDEN, found.status))
    before, after = (
        figure.subfigs[0].axes[0]
        for figure in (
            scan_figure(scan, scene.part),
            correction_figure(found, scene.part, scene.camera),
        )
    )
    np.testing.assert_allclose(before.axis(), after.axis())
    grey = after.lines[0].get_xydata()
    np.testing.assert_allclose(grey, scan.pixel[hidden], atol=1e-3)
    corners = scene.camera.project(scene.part.vertices)
    for axes, count in ((before, len(hidden)), (after, (~hidden).sum())):
        (patch,) = axes.patches
        shape = patch.get_path()
        np.testing.assert_allclose(
            shape.get_extents().get_points(), [corners.min(0), corners.max(0)]
        )
        sides = np.diff(shape.vertices.reshape(-1, 4, 2), axis=1)
        assert (np.linalg.det(sides[:, :2]) >= 0).all()
        (cells,) = axes.collections
        width = cells.get_paths()[0].get_extents().width
        np.testing.assert_allclose(width, np.ptp(axes.get_xlim()) / 120, rtol=1e-6)
        # Within half a cell of the line's points, which are some pixels apart.
        off, _ = cKDTree(scan.pixel).query(cells.get_offsets())
        assert off.max() < 0.01 * np.ptp(axes.get_xlim())
        assert count / 4 < len(cells.get_offsets()) <= count
    _, numbers = scan.save(tmp_path / "line.xyz", regions=scan.regions(scene.part))
    page = read_page(report_of(numbers))
    assert "those of one line of a laser lie in a plane" in page.text
    assert "U is" not in page.text
    (regions,) = (table for table in page.tables if table[0][0] == "region")
    assert regions[0][1:3] == ["points", "median"]
    assert regions[1][:2] == ["lateral", str(len(scan.points))]


def test_a_report_has_distances_at_the_drawings_temperature(tmp_path: Path) -> None:
    """Of a block, whose planes have no size, that is 1 % larger than its drawing."""
    mesh = trimesh.creation.box((20.2, 30.3, 40.4))
    part = part_of_mesh(mesh.vertices, mesh.faces, name="block")
    part = evolve(part, growth=Growth(1e-5, 293.15, 1293.15))
    points, face = part.surface.even_places(2000)
    origin = {"assumptions": {"field_origin": "a solver"}, "part": {"path": "block"}}
    found = Correction(
        *(points, np.zeros_like(points), np.zeros(len(points), dtype=np.int64), face),
        *(part.face_normals[face], "fringe"),
        provenance=origin | {"field": None, "scene": {"path": "scene.xml"}, "variant": "llvm"},
        growth=part.growth,
    )
    features = found.features(part)
    _, numbers = found.save(tmp_path / "c.xyz", features, related=found.relations(features))
    tables = read_page(report_of(numbers)).tables
    (table,) = (table for table in tables if "planes" in table[0])
    headings, rows = table[0], [row for row in table if "Distance" in row[0]]
    column = headings.index("On the drawing at 20 °C")
    assert [row[column] for row in rows] == ["20.0000 mm", "30.0000 mm", "40.0000 mm"]
    assert all(
        row[-1].endswith("; not known: air around the part, growth of the part)") for row in rows
    )


def test_a_report_has_u_by_group_and_the_verdict(variant: str, tmp_path: Path) -> None:
    """5 % of what the air does to the diameter, and the sensor."""
    scene = load_scene(folder_of("fringe_cylinder") / "scene.xml", {"scale": 0.05}, variant=variant)
    inputs = Inputs(air=0.05, sensor_mm=0.002)
    found = correct(measure(scene).points, scene, inputs=inputs)
    asked = {"cylinder:lateral": Tolerance(27.0, -0.05, 0.05)}
    (feature,) = found.features(scene.part, ["cylinder"], tolerances=asked)
    _, numbers = found.save(tmp_path / "c.xyz", [feature])
    page = read_page(report_of(numbers))
    (table,) = (one for one in page.tables if one[0][0] == "group")
    assert table[0] == ["group", "u of diameter of cylinder lateral", "type", "from"]
    size = feature.size
    assert size.uncertainty is not None
    by_air = 0.05 * abs(size.difference("corrected", "measured") or 0.0)
    u, share = (
        {group: re.split(r" \(|\)", value)[number] for group, value, *_ in table[1:]}
        for number in (0, 1)
    )
    assert u["contrast of the air"] == f"{1e3 * by_air:.3g} µm"
    assert len(u) == len(size.uncertainty.contributions) == 2
    shares = [float(text.removesuffix(" %")) for text in share.values()]
    assert sum(shares) == pytest.approx(100.0, abs=1.0)
    (sizes,) = (one for one in page.tables if one[0][0] == "size")
    stated = dict(zip(*sizes, strict=True))
    assert stated["tolerance"] == "26.95000 .. 27.05000 mm"
    assert stated["verdict"] == "accepted"
    assert stated["corrected"] == f"{size.uncertainty.value:.5f} mm"
    assert stated["U (95 %)"] == f"{size.uncertainty.expanded:.5f} mm"
    assert stated["hot air makes it"].endswith(" µm smaller")
    assert "26.95000 .. 27.05000 mm: accepted" in page.by_id["answer"]
    assert "Not in U: turbulence" in page.by_id["uncertainty"]
    assert " um" not in page.text


@pytest.mark.parametrize("count", [1, 4])
def test_a_report_prints_on_one_sheet(variant: str, tmp_path: Path, count: int) -> None:
    """Of a correction with toleranced sizes; the picture that turns asks for no other file.

    What is folded is not printed, nor the picture that turns, in whose place is an image.
    """
    scene = load_scene(folder_of("fringe_cylinder") / "scene.xml", {"scale": 0.05}, variant=variant)
    inputs = Inputs(air=0.05, sensor_mm=0.002, wall_k=10.0, pressure_pa=200.0)
    found = correct(measure(scene).points, scene, inputs=inputs)
    asked = {"cylinder:lateral": Tolerance(27.0, -0.05, 0.05)}
    features = found.features(scene.part, ["cylinder"], tolerances=asked)
    values = found.values(features, found.regions(scene.part))
    values["features"] = [
        row | {"region": f"lateral {number}"}
        for number in range(count)
        for row in values["features"]
    ]
    numbers = tmp_path / "c.json"
    numbers.write_text(json.dumps(values))
    png = figure_bytes(correction_figure(found, scene.part, scene.camera))
    file, wrong = tmp_path / "r.html", list[str]()
    write_scan_report(file, values, FileOrigin.of(numbers), png, png, frame(picture_of(found)))
    with browser() as program:
        # A frame that is not to be seen is not drawn.
        page = program.new_page(viewport={"width": 1300, "height": 2400})
        page.on("console", lambda message: wrong.append(message.text))
        page.on("request", lambda request: wrong.append(request.url))
        page.goto(file.as_uri())
        page.frame_locator("iframe").locator("html[data-drawn]").wait_for(state="attached")
        hidden, folded = page.locator("#space img"), page.locator("#setting table").first
        assert not hidden.is_visible()
        assert not folded.is_visible()
        paper = page.pdf(prefer_css_page_size=True)
        page.emulate_media(media="print")
        assert hidden.is_visible()
        assert not page.locator("iframe").is_visible()
        page.emulate_media(media="screen")
        page.locator("#setting summary").click()
        assert folded.is_visible()
    # A srcdoc frame is no request beyond the page.
    assert [text for text in wrong if text != "about:srcdoc"] == [file.as_uri()]
    assert len(re.findall(rb"/Type\s*/Page\b", paper)) == 1
    assert re.search(rb"/MediaBox\s*\[0 0 59[45][.\d]* 84[12]", paper), "A4"


def test_a_report_says_where_the_devices_stand_and_how_fields_count(variant: str) -> None:
    """By NumPy from the scene's sensors; members are listed with the largest weight first."""
    scene = load_scene(folder_of("fringe_cylinder") / "scene.xml", {"scale": 0.05}, variant=variant)
    scan = measure(scene)
    values = scan.as_dict() | {"features": []}
    setting = setting_of(values)
    assert scene.second is not None
    for name, device in (("Camera", scene.camera), ("Second device", scene.second)):
        place = ", ".join(f"{x:.1f}" for x in device.origin)
        assert setting[name].startswith(f"at ({place}) mm; pinhole, focal length")
    base = np.linalg.norm(scene.camera.origin - scene.second.origin)
    assert setting["Distance of both"] == f"{base:.1f} mm"
    angle = np.degrees(np.median(scan.angle))
    assert setting["Angle of both lines of sight"].startswith(f"{angle:.3g}°")
    assert setting["Field"].startswith("field.vtu")
    members = [{"weight": weight, "label": f"{weight}.vtu"} for weight in (0.06, 0.94)]
    setting = setting_of(values | {"ensemble": {"members": members}})
    assert setting["Fields by weight"] == "0.940 0.94.vtu; 0.060 0.06.vtu"
