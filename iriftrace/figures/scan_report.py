"""The report of a simulated measurement or a correction: one HTML page."""

from __future__ import annotations

import json
import math
from pathlib import Path

from iriftrace.core.errors import InputError
from iriftrace.core.plain import JsonObject, structured
from iriftrace.core.units import ZERO_CELSIUS_K
from iriftrace.features.fitted import cone_place
from iriftrace.features.quantity import DRAWING, Quantity
from iriftrace.field.source import stated_source, synthetic_mark
from iriftrace.figures.page import (
    Rows,
    camera_text,
    file_text,
    in_page,
    name_of,
    origin_text,
    value_text,
    write_page,
)
from iriftrace.scene.hot_air import OUTSIDE
from iriftrace.triangulation import correction, scan
from iriftrace.triangulation.statistics import RegionValues

SCHEMAS = {scan.SCHEMA: "cold", correction.SCHEMA: "corrected"}
"""Results with such a report, and the names of their features' clouds without air."""


def read_numbers(path: Path) -> tuple[Path, JsonObject]:
    """The JSON file of a scan or correction, which may be given by its cloud, and its values."""
    file = path if path.suffix.lower() == ".json" else path.with_suffix(".json")
    if not file.is_file():
        raise InputError(
            f"The file {file} does not exist; give a sweep (.nc), or what iriftrace measure or "
            "correct wrote."
        )
    try:
        values = json.loads(file.read_text(encoding="utf-8"))
        schema = str(values["schema"])
    except (OSError, ValueError, LookupError, TypeError):
        schema = ""
    kinds = {known.partition("/")[0]: known for known in SCHEMAS}
    current = kinds.get(schema.partition("/")[0])
    if current is not None and schema != current:
        raise InputError(
            f"{file} has schema {schema!r} instead of {current!r}, so it was written by another "
            "version of iriftrace; measure or correct again with this one."
        )
    if current is None:
        raise InputError(
            f"{file} holds no numbers of iriftrace measure or correct for a report; "
            "give a sweep (.nc), or a cloud that lies next to its .json."
        )
    return file, values


def scan_report(values: JsonObject) -> dict[str, object]:
    """Texts and tables of the page from the JSON values of a scan or correction."""
    true = SCHEMAS[values["schema"]]
    simulated = true == "cold"
    assumed, counts = values["assumptions"], values["points"]
    what = "What hot air adds to a measurement" if simulated else "Measured cloud, corrected"
    growth = values["growth"]
    at = f"at {growth['reference_k'] - ZERO_CELSIUS_K:g} °C" if growth else ""
    features = [_feature(row, true, at) for row in values["features"]]
    relations = [_relation(row, true, at) for row in values.get("relations", ())]
    measured = structured(values.get("regions", ()), tuple[RegionValues, ...])
    one_line = any(region.measured is None for region in measured)
    line = "; those of one line of a laser lie in a plane" if one_line else ""
    return dict(
        title=f"{what}: {name_of(values['part'])}",
        answer=tuple(_answer(values, simulated)),
        doubtful=tuple(_doubtful(values, simulated)),
        caption="Left: the camera's picture, coloured by the "
        + ("error along the normal." if simulated else "refraction error that was removed."),
        features=features,
        feature_note=_feature_note(bool(at)),
        no_feature="No region of the part has enough points that determine a plane, cylinder, cone "
        f"or sphere{line}.",
        relations=relations,
        regions=tuple(_region(region) for region in measured if region.points),
        region_note="Along the part's outward normal: "
        + ("the error of the points." if simulated else "the correction of the points.")
        + ("" if one_line else " Area measured: that of the triangles with a point."),
        points=tuple((key.replace("_", " "), f"{count:,}") for key, count in counts.items()),
        setting=(
            ("Part", file_text(values["part"])),
            *_fields(values),
            ("Scene", file_text(values["scene"])),
            ("Sensor", values["system"]),
            *_devices(values),
            ("Mitsuba variant", str(values["variant"])),
        ),
        assumptions=tuple(
            (key.replace("_", " "), value_text(value)) for key, value in assumed.items()
        ),
    )


def write_scan_report(path: Path, result: Path) -> tuple[str, ...]:
    """Write the report of a scan or correction (its .json, or the cloud next to it).

    Returns
    -------
    tuple of str
        Why the picture is missing, a sentence, if it is.

    Raises
    ------
    InputError
        The result is neither of the two, or the file cannot be written.
    """
    file, values = read_numbers(result)
    picture = file.with_suffix(".png")
    png = in_page(picture.read_bytes()) if picture.is_file() else ""
    try:
        content = scan_report(values)
    except (LookupError, TypeError, ValueError) as error:
        raise InputError(f"{file} is damaged ({error!r}); compute the result again.") from error
    write_page(
        path,
        "scan_report.html.jinja",
        file,
        str(values.get("version", "")),
        content=content,
        png=png,
    )
    return () if png else (f"There is no picture {picture}: compute the result with figures.",)


def _um(millimetres: float | None) -> str:
    return "not known" if millimetres is None else f"{1e3 * millimetres:.3g}"


def _answer(values: JsonObject, simulated: bool) -> list[str]:
    counts = values["points"]
    if simulated:
        error, left = values["error_normal_mm"], values["best_fit"]["error_normal_mm"]
        return [
            f"{counts['measured']:,} points were measured. Error along the normal: median "
            f"{_um(error['median'])} µm, rms {_um(error['rms'])} µm, after a rigid best fit rms "
            f"{_um(left['rms'])} µm."
        ]
    error, u = values["error_mm"], values.get("u_normal_mm")
    doubt = "" if u is None else f", with a standard uncertainty of {_um(u['median'])} µm (median)"
    return [
        f"{counts['corrected']:,} of {counts['measured']:,} points are corrected, by "
        f"{_um(error['median'])} µm (median; 95th percentile {_um(error['p95'])} µm){doubt}."
    ]


def _doubtful(values: JsonObject, simulated: bool) -> list[str]:
    """Facts that limit the reliability of the numbers."""
    assumed = values["assumptions"]
    mark = synthetic_mark(stated_source(values.get("field")))
    said = [f"{origin_text(mark, assumed['field_origin'])}."]
    said += [str(assumed[key]) for key in ("field_fit", OUTSIDE) if key in assumed]
    if larger := values.get("larger"):
        by = 100 * (larger["scale"] - 1.0)
        said.append(
            f"The cloud is {abs(by):.2f} % {'larger' if by > 0 else 'smaller'} than the part."
        )
    if not simulated and "u_normal_mm" not in values:
        said.append(
            "No uncertainty of the correction is stated, as that of the field is not known."
        )
    return said


def _fields(values: JsonObject) -> Rows:
    """The field, or the members of an ensemble with their weights, the largest first."""
    if "ensemble" not in values:
        return (("Field", file_text(values["field"] or {})),)
    members = sorted(values["ensemble"]["members"], key=lambda member: -member["weight"])
    listed = "; ".join(f"{member['weight']:.3f} {member['label']}" for member in members)
    return (("Fields by weight", listed),)


def _devices(values: JsonObject) -> Rows:
    """Where the devices of a simulated measurement stand, and the angle of their lines."""
    if "devices" not in values:
        return ()
    both = [values["devices"][name] for name in ("camera", "second")]
    places = [[row[3] for row in device["matrix"][:3]] for device in both]
    texts = [
        f"at ({', '.join(f'{x:.1f}' for x in place)}) mm; {camera_text(device)}"
        for place, device in zip(places, both, strict=True)
    ]
    texts.append(f"{math.dist(*places):.1f} mm")
    texts.append(f"{values['angle_deg']['median']:.3g}° (median of the points)")
    names = ("Camera", "Second device", "Distance of both", "Angle of both lines of sight")
    return tuple(zip(names, texts, strict=True))


def _feature_note(expanded: bool) -> str:
    text = (
        "Diameters, of a cone at the stated point of its axis; for planes the form deviation. "
        "U is expanded (k = 2, larger for few fields)"
    )
    if expanded:
        text += " and holds for the size on the drawing, at its temperature"
    return f"{text}."


def _feature(row: JsonObject, true: str, at: str) -> dict[str, str]:
    """Cells by heading; `at` is that of the size on the drawing, if there is one."""
    size = Quantity.of(row)
    sized = size.by_cloud["measured"] is not None
    values = row["size_mm"] if sized else row["form_mm"]
    measured, cold = values["measured"], values[true]
    place = cone_place(row["kind"], row["position_mm"][true])
    return {
        "feature": row["kind"],
        "region": " at ".join(filter(None, (row["region"] or "all points", place))),
        "points": f"{row['points']:,}",
        "measured (mm)": f"{measured:.4f}",
        f"{true} (mm)": f"{cold:.4f}",
        "air (µm)": _um(measured - cold),
        **({f"{at} (mm)": f"{values[DRAWING]:.4f}"} if at else {}),
        **({} if true == "cold" else {"U": _expanded(size)}),
    }


def _expanded(value: Quantity) -> str:
    """The whole uncertainty of a value, and its parts; "" of a feature without a size."""
    u = value.uncertainty
    if u is None:
        return ""
    angle = value.unit == "deg"
    parts = [f"{name} {_difference(u.coverage_factor * x, angle)}" for name, x in u.parts.items()]
    parts += [f"{name} not known" for name in u.missing]
    return f"{_difference(u.expanded, angle)} ({', '.join(parts)})"


def _relation(row: JsonObject, true: str, at: str) -> dict[str, str]:
    """Cells by heading, as of `_feature`."""
    value = Quantity.of(row)
    angle = value.unit == "deg"
    names = ("measured", true, DRAWING) if at else ("measured", true)
    measured, cold, *drawn = (
        f"{value.by_cloud[name]:.4f}{'°' if angle else ' mm'}" for name in names
    )
    return {
        "": row["kind"],
        "planes": " and ".join(str(region or "all points") for region in row["regions"]),
        "measured": measured,
        true: cold,
        "air": _difference(value.difference("measured", true), angle),
        **({at: drawn[0]} if at else {}),
        **({} if true == "cold" else {"U": _expanded(value)}),
    }


def _difference(value: float | None, angle: bool) -> str:
    """A difference of angles, deg, in minutes, or of lengths, mm, in micrometres."""
    if value is None:
        return "not known"
    return f"{60 * value:.2g}\N{PRIME}" if angle else f"{_um(value)} µm"


def _region(region: RegionValues) -> dict[str, str]:
    """Cells by heading."""
    values = region.along_normal_mm
    assert values is not None
    area = {} if region.measured is None else {"area measured": f"{region.measured:.0%}"}
    return {
        "region": region.region,
        "points": f"{region.points:,}",
        **area,
        "median (µm)": _um(values["median"]),
        "rms (µm)": _um(values["rms"]),
        "95 % below (µm)": _um(region.size_p95_mm),
    }
