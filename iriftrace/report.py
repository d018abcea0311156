"""The report of a sweep: one HTML page that needs nothing else, neither Python nor a network."""

from __future__ import annotations

import base64
from importlib import resources
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from attrs import frozen

from iriftrace.checksum import sha256_of
from iriftrace.report_content import report_content
from iriftrace.sweep_pictures import draw_sweep
from iriftrace.whole_file import whole_file

if TYPE_CHECKING:
    import xarray as xr

    from iriftrace.sweep_summary import SweepSummary

_TEMPLATE = "templates/report.html.jinja"

# In the order of the page; a picture that is not listed comes last, under its file's name.
_CAPTIONS = {
    "pareto": "Coverage against displacement, coloured by lateral resolution. Ringed poses are "
    "beaten by no other one in everything at once.",
    "map_score": "Combined score over the direction from which the camera looks.",
    "map_displacement": "Displacement over the direction from which the camera looks.",
    "map_coverage": "Seen share of the area over the direction from which the camera looks.",
    "map_axial": "Resolution along the line of sight.",
    "map_lateral": "Resolution across the line of sight.",
    "scene_score": "The camera poses around the part, coloured by the combined score.",
    "scene_displacement": "The camera poses around the part, coloured by displacement.",
    "scene_coverage": "The camera poses around the part, coloured by coverage.",
    "scene_axial": "The camera poses around the part, coloured by axial resolution.",
    "scene_lateral": "The camera poses around the part, coloured by lateral resolution.",
    "view_smallest_displacement": "What the pose with the smallest displacement sees.",
    "view_largest_displacement": "What the pose with the largest displacement sees.",
    "faces_displacement": "How far hot air moves the points of each face, over all poses.",
    "faces_times_seen": "How many poses see each face.",
    "faces_incidence": "The best angle at which any pose sees each face.",
    "histograms": "How the metrics are distributed over the poses.",
    "histograms_normalised": "The same, normalised as they enter the score.",
    "rays": "What became of the rays of each pose, and how much they met.",
}


@frozen
class Figure:
    """A picture within the page.

    Attributes
    ----------
    name : str
    caption : str
    uri : str
        The picture itself, as a ``data:`` URI.
    """

    name: str
    caption: str
    uri: str


def write_report(
    path: Path, sweep: Path, dataset: xr.Dataset, summary: SweepSummary, *, top: int = 10
) -> tuple[str, ...]:
    """Write the report of a sweep as one HTML file.

    Parameters
    ----------
    path
        The HTML file; an existing one is replaced when the new one is complete.
    sweep
        The sweep's file; images that it kept lie beside it.
    dataset, summary
        What it holds.
    top
        Rows of the ranking.

    Returns
    -------
    tuple of str
        Which pictures are missing and why, a sentence each; the page says so, too.

    Raises
    ------
    InputError
        The file cannot be written, or no row is wanted.
    """
    from jinja2 import Environment, StrictUndefined

    content = report_content(dataset, summary, top)
    with TemporaryDirectory() as folder:
        pictures = draw_sweep(dataset, summary, sweep.parent, Path(folder), vectors=False)
        figures = [_figure(file) for file in pictures.files]
    order = list(_CAPTIONS)
    figures.sort(key=lambda f: order.index(f.name) if f.name in order else len(order))
    source = resources.files("iriftrace").joinpath(_TEMPLATE).read_text(encoding="utf-8")
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    text = environment.from_string(source).render(
        content=content,
        figures=figures,
        missing=pictures.missing,
        sweep=sweep.name,
        sha256=sha256_of(sweep),
        version=str(dataset.attrs.get("version", "")),
    )
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return pictures.missing


def _figure(file: Path) -> Figure:
    picture = base64.b64encode(file.read_bytes()).decode("ascii")
    return Figure(
        file.stem, _CAPTIONS.get(file.stem, file.stem), f"data:image/png;base64,{picture}"
    )
