"""Options that all studies share."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from attrs import frozen
from cyclopts import Group, Parameter

from iriftrace.cli.air_options import AirOptions
from iriftrace.cli.camera_options import CameraOptions
from iriftrace.cli.field_options import FieldOptions
from iriftrace.cli.options import Whole
from iriftrace.cli.part_options import PartOptions
from iriftrace.errors import InputError

if TYPE_CHECKING:
    from iriftrace.studies.mode import Mode

StudiedPart = Annotated[Path, Parameter(help="The part's surface mesh.")]
Output = Annotated[
    Path,
    Parameter(name=["-o", "--output"], help="The netCDF file; the figure is written beside it."),
]
References = Annotated[list[str] | None, Parameter(name="--reference", negative=())]
Layers = Annotated[Whole, Parameter(help="Number of shells.")]

MODE = Group("Second mode, compared with ours (gradient, midpoint, refract, 0)", sort_key=0)


@Parameter(name="*", group=MODE)
@frozen
class ModeOptions:
    """How shells are made and rays refracted in the second mode; by default the paper's.

    Parameters
    ----------
    normals
        Normals at which rays are refracted.
    index_rule
        Where shells lie between the layers that they separate.
    inside_hit
        What becomes of rays that meet a shell from its inside: refracted, or dropped.
    drop_inner
        How many of the innermost shells are left out; one number, or one for each field, "3,3,0,0".
    explain
        Also the second mode with one of its choices at a time replaced by ours.
    """

    normals: Literal["gradient", "facet"] = "facet"
    index_rule: Literal["midpoint", "graded", "outer"] = "outer"
    inside_hit: Literal["refract", "drop"] = "drop"
    drop_inner: str = "0"
    explain: Annotated[bool, Parameter(negative=())] = False

    def modes(self) -> list[Mode]:
        """Ours, the second one, and those between them if they are asked for."""
        from attrs import evolve

        from iriftrace.studies.mode import OURS, PAPERS, one_change_each

        second = evolve(
            PAPERS,
            normals=self.normals,
            index_rule=self.index_rule,
            inside_hit=self.inside_hit,
            drop_inner=whole_numbers(self.drop_inner, "--drop-inner"),
        )
        choices = ("normals", "index_rule", "inside_hit")
        if any(getattr(second, name) != getattr(PAPERS, name) for name in choices):
            second = evolve(second, name="other")
        return [OURS, second, *(one_change_each(second) if self.explain else [])]


@Parameter(name="*")
@frozen
class StudyOptions:
    """How a study reads its fields and its part, and how it traces them.

    Parameters
    ----------
    variant
        Mitsuba variant, llvm_ad_mono or cuda_ad_mono.
    """

    variant: str | None = None
    mode: ModeOptions = ModeOptions()
    air: AirOptions = AirOptions()
    field: FieldOptions = FieldOptions()
    part: PartOptions = PartOptions()
    camera: CameraOptions = CameraOptions()


def whole_numbers(text: str, option: str) -> list[int]:
    """Whole numbers of a list such as "1:20,40,80", in which 1:20 stands for 1, 2 ... 20."""
    values: list[int] = []
    for piece in text.split(","):
        first, colon, last = piece.partition(":")
        if not first.strip().isdecimal() or (colon and not last.strip().isdecimal()):
            raise InputError(
                f'{option} is "{text}"; give whole numbers separated by commas, or a range such as '
                "1:20."
            )
        start = int(first)
        stop = int(last) if colon else start
        if stop < start or stop - start > 10_000:
            raise InputError(
                f'{option} is "{text}", but the range {piece.strip()} does not rise, or is too '
                "long; write it as FIRST:LAST."
            )
        values += range(start, stop + 1)
    return values
