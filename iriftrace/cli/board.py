"""The command ``iriftrace board``: where to put the board that tells which air it was."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from iriftrace.cli import checks
from iriftrace.cli.console import print_table, say, working
from iriftrace.cli.options import Flag, Output
from iriftrace.cli.trace_options import Tracing, load
from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError
from iriftrace.core.units import Length
from iriftrace.part import sizes
from iriftrace.tracing.options import TRACE_AS_STATED

Places = Annotated[
    list[str] | None,
    Parameter(
        name="--place",
        help="The board's frame to the world's, as --part-transform of iriftrace scene; "
        "repeatable. By default eight upright places around the part, 100 mm off the box around "
        "it.",
    ),
]


def board(
    scene: Path,
    *,
    place: Places = None,
    size: sizes.BoardSize = sizes.BOARD_SIZE,
    pitch: Length = sizes.PITCH,
    noise: float = 0.05,
    camera_motion: Flag = False,
    feature: list[str] | None = None,
    enough: float = 0.1,
    output: Output | None = None,
    trace: Tracing = TRACE_AS_STATED,
) -> None:
    """Rank places of a board by the uncertainty of a feature that a fit to its dots leaves.

    For each place: how many dots are seen past the part, U of the features by the air after
    ``iriftrace fit``, and how many dots or pictures are enough. The camera stands opposite, at its
    distance from the part in the scene. U holds for air that is a mixture of the members.

    Example: ``iriftrace board part/scene.xml --feature cylinder --size 300x200``

    Parameters
    ----------
    scene
        The scene of the hot part, with several members and the two devices that measure it.
    size
        Width and height of the board, mm.
    pitch
        Distance between the centres of neighbouring dots.
    noise
        Standard deviation of a component of a dot's shift in one pair of pictures, px.
    camera_motion
        The fit will find a motion of the camera, too.
    feature
        Feature whose U counts, as for ``measure``: "cylinder:lateral", or "cylinder" for all
        regions that are one; repeatable. By default all features, and distances and angles.
    enough
        Fraction of U without a board that is little enough, 0 to 1.
    output
        The numbers, .json, with the camera of each place; by default they are only printed.
    """
    from iriftrace.core.files import write_json
    from iriftrace.core.mesh.transform import parse_transform
    from iriftrace.measuring.features.choice import checked_choices
    from iriftrace.measuring.fit.board_placement import board_placement
    from iriftrace.part.board import Board

    checks.scenes(scene)
    checks.output(output, "places.json")
    if not 0.0 < enough < 1.0:
        raise InputError(
            f"{enough:g} is no fraction of U that is enough; give one between 0 and 1, such as "
            "0.1.",
            code="board.not_a_fraction",
            argument="enough",
        )
    dots = Board(size, pitch)
    places = [parse_transform(text) for text in place or []]
    loaded = load(scene, trace)
    with working("Tracing the board's places"):
        found = board_placement(
            loaded,
            dots,
            places,
            choices=checked_choices(feature or (), loaded.part),
            noise_px=noise,
            camera_motion=camera_motion,
        )
    features = found[0].features
    print_table(
        "Places of the board, the best first",
        (
            *("place", "at (mm)", "dots"),
            *(f"U ({one.unit})" for one in features[:MOST]),
            *("left", "dots enough", "pictures enough"),
        ),
        [
            (
                one.number,
                _point(one.to_world[:3, 3]),
                f"{one.dots:,}",
                *(f"{u:.2g}" for u in one.expanded()[:MOST]),
                f"{one.left():.1%}",
                (one.dots_for(enough) or "") if one.dots else "no dot is seen",
                one.pictures_for(enough) or "",
            )
            for one in found
        ],
    )
    for one in features[:MOST]:
        say(f"U of {one.name} without a board: {one.before:.2g} {one.unit} (by the air).")
    say(
        f"Enough leaves {enough:.0%} of it, with one picture of fewer dots, or with the mean of "
        "more pictures of all; blank: never."
    )
    if output is not None:
        rows = [
            {
                **one.as_dict(),
                "dots_enough": one.dots_for(enough),
                "pictures_enough": one.pictures_for(enough),
            }
            for one in found
        ]
        write_json(output, {"schema": SCHEMA, "enough": enough, "places": rows})
        say(f"Files: {output}")


def _point(values: FloatArray) -> str:
    # Adding 0 turns -0 into 0.
    return ", ".join(f"{value:.0f}" for value in values.round() + 0.0)


MOST = 3
"""Number of features whose U is printed."""

SCHEMA = "iriftrace.board/1"
"""Value of ``schema`` in the JSON."""
