"""Draughts: direction, inlets, symmetry, times, and what is refused; nothing is solved here."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from iriftrace.core.errors import InputError
from iriftrace.flow.simulate.case import RECORD, STANDARD_SIMULATION, Case, natural_case
from iriftrace.flow.simulate.case_files import write_case
from iriftrace.flow.simulate.draught import SLOWEST_RISE, Draught, draught_from, leans
from iriftrace.flow.simulate.options import SimulationOptions
from iriftrace.flow.simulate.simulate import prepare
from iriftrace.flow.simulate.times import natural_times
from iriftrace.part.part import Part
from iriftrace.part.wall_temperature import WallTemperatures
from validation.field_files.openfoam import entry

WALL = WallTemperatures(1373.15)

COARSE = SimulationOptions(resolution="coarse")


def wind(speed: float, *source: float) -> Draught:
    found = draught_from(speed, source)
    assert found is not None
    return found


def windy(part: Part, draught: Draught | None, mirrors: str = "") -> Case:
    return natural_case(part, COARSE, wall=WALL, draught=draught, mirrors=mirrors)


@pytest.mark.parametrize(
    ("source", "velocity", "inlets"),
    [
        ((0.0,), (-0.2, 0.0, 0.0), ("xmax",)),
        ((90.0,), (0.0, -0.2, 0.0), ("ymax",)),
        ((180.0,), (0.2, 0.0, 0.0), ("xmin",)),
        ((-90.0,), (0.0, 0.2, 0.0), ("ymin",)),
        ((30.0,), (-0.2 * np.cos(np.pi / 6), -0.1, 0.0), ("xmax", "ymax")),
        ((0.0, 3.0, 0.0), (0.0, -0.2, 0.0), ("ymax",)),
        ((-4.0, 0.0, -3.0), (0.16, 0.0, 0.12), ("xmin",)),
    ],
)
def test_air_flows_away_from_where_it_comes(
    source: tuple[float, ...], velocity: tuple[float, ...], inlets: tuple[str, ...]
) -> None:
    """And enters through the vertical sides that face its source."""
    draught = wind(0.2, *source)
    assert draught.velocity == pytest.approx(velocity, abs=1e-12)
    assert draught.inlets == inlets


@pytest.mark.parametrize(
    ("speed", "source", "code"),
    [
        (-0.1, (0.0,), "draught.speed"),
        (40.0, (0.0,), "draught.speed"),
        (0.1, (0.0, 0.0, 1.0), "draught.vertical"),
        (0.1, (0.5, 0.0, -1.0), "draught.vertical"),
        (0.1, (0.0, 0.0, 0.0), "draught.no_direction"),
        (0.1, (0.0, 1.0), "draught.numbers"),
    ],
)
def test_what_is_no_draught_is_refused(speed: float, source: tuple[float, ...], code: str) -> None:
    with pytest.raises(InputError) as error:
        draught_from(speed, source)
    assert error.value.code == code
    assert error.value.argument == (None if code == "draught.speed" else "draught_from")


def test_no_speed_is_still_air() -> None:
    assert draught_from(0.0, (90.0,)) is None


def test_upstream_side_blows_and_the_others_stay_open(cylinder: Part, tmp_path: Path) -> None:
    """The air is at rest nowhere at the beginning; the symmetry plane along the wind is kept."""
    write_case(windy(cylinder, wind(0.1, 90.0), "x"), tmp_path)
    for name, inlet, free in (
        ("U", r"fixedValue; value uniform \(0\.0 -0\.1 0\.0\)", "pressureInletOutletVelocity"),
        ("T", r"fixedValue; value uniform 293\.15", "inletOutlet"),
        ("p_rgh", "fixedFluxPressure", "totalPressure"),
    ):
        text = (tmp_path / "0" / name).read_text()
        assert re.search(rf'"\(ymax\)" {{ type {inlet}', text), name
        assert re.search(rf'"\(xmax\|ymin\|bottom\|top\)" {{ type {free}', text), name
        assert re.search(r"xmin { type symmetryPlane", text), name
    assert entry(tmp_path / "0/U", "internalField") == "uniform (0.0 -0.1 0.0)"


def test_draught_through_the_symmetry_plane_is_refused(cylinder: Part) -> None:
    """Wind along y crosses the plane y = 0, and an oblique one both."""
    windy(cylinder, wind(0.1, 90.0), "x")
    windy(cylinder, None, "xy")
    for source, mirrors, axis in ((90.0, "y", "y"), (0.0, "xy", "x"), (45.0, "y", "y")):
        with pytest.raises(InputError, match=f"leave {axis} out") as error:
            windy(cylinder, wind(0.1, source), mirrors)
        assert error.value.code == "draught.across_symmetry"
        assert error.value.argument == "symmetry"


def test_record_and_folder_tell_draughts_apart(cylinder: Part, tmp_path: Path) -> None:
    folder = tmp_path / "case"
    prepare(windy(cylinder, wind(0.1, 90.0)), folder)
    assert json.loads((folder / RECORD).read_text())["draught_m_s"] == pytest.approx([0, -0.1, 0])
    assert prepare(windy(cylinder, wind(0.1, 0.0, 1.0, 0.0)), folder), "the same draught"
    for other in (None, wind(0.12, 90.0), wind(0.1, 270.0)):
        with pytest.raises(InputError, match="differs in draught_m_s"):
            prepare(windy(cylinder, other), folder)


def test_time_until_the_plume_is_bent(cylinder: Part) -> None:
    """The draught crosses 307 mm of air along y; a slow one is overtaken by the convection."""
    still, slow, fast = (
        windy(cylinder, wind(speed, 90.0) if speed else None).times.end for speed in (0, 0.02, 0.5)
    )
    assert (still, slow) == (2.0, 4.0)
    assert fast == pytest.approx(2.0 + 0.307 / 0.5, abs=0.01)
    assert natural_times(SimulationOptions(end_time=1.0), 170.0, 1373.15, 9.0).end == 1.0


def test_plume_is_watched_where_the_wind_carries_it(cylinder: Part) -> None:
    """Above the part and leeward, inside the air that is solved."""
    still, windy_case = windy(cylinder, None), windy(cylinder, wind(0.1, 90.0))
    assert still.probes == still.domain.probes
    points = np.array(windy_case.probes)
    assert len(points) == 3 * len(still.probes)
    assert points[:, 1].max() == pytest.approx(still.probes[0][1]), "none windward"
    assert points[:, 1].min() < cylinder.bounds[0, 1] - 50.0
    assert (points > windy_case.domain.lower).all()


def test_mesh_is_fine_where_winds_lean_the_plume(cylinder: Part) -> None:
    """The fine solution at 0.15 m/s has the plume at y = -18, -41 mm, 80 and 160 mm up."""
    family = wind(0.05, 90.0), wind(0.15, 90.0)
    still, alone, member = (
        natural_case(cylinder, STANDARD_SIMULATION, wall=WALL, draught=own, family=others)
        for own, others in ((None, ()), (family[1], ()), (None, family))
    )
    fine = still.domain.boxes[-1].level
    for height, y in ((80.0, -18.0), (160.0, -41.0)):
        in_plume = [
            any(
                box.level == fine and box.lower[1] < y < box.upper[1] and box.lower[2] <= height
                for box in case.domain.boxes
                if height <= box.upper[2]
            )
            for case in (still, alone, member)
        ]
        assert in_plume == [False, True, True]
    kept = np.array((still.domain.kept_lower, alone.domain.kept_lower, still.domain.kept_upper))
    assert kept[1, 1] < kept[0, 1] - 30.0, "more air to the lee"
    assert np.array_equal(alone.domain.kept_upper, kept[2])
    assert all(box.lower[1] > kept[1, 1] - 20.0 for box in alone.domain.boxes[3:])


def test_draughts_of_one_direction_lean_together() -> None:
    winds = [wind(speed, turn) for turn in (0.0, 90.0) for speed in (0.1, 0.3)]
    one, other = leans(winds, rise=0.5)
    assert (one.downwind, other.downwind) == ((-1.0, 0.0), (0.0, -1.0))
    assert one.most == other.most == pytest.approx(0.3 / (0.5 * SLOWEST_RISE))


def test_mirror_image_of_a_draught() -> None:
    draught = wind(0.1, 30.0)
    for axes, degrees in (("x", 150.0), ("y", 330.0), ("xy", 210.0)):
        image = draught.mirrored(axes)
        assert image.velocity == pytest.approx(wind(0.1, degrees).velocity)
        assert image.text == f"draught of 0.1 m/s from {degrees:g} deg"
