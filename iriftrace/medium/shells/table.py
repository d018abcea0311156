"""Description of a scene's air: the JSON table next to its shells."""

from __future__ import annotations

from attrs import evolve, field, frozen

from iriftrace.medium.air.refractivity import Air, dispersion
from iriftrace.medium.source import FieldSource

SCHEMA = "iriftrace.shells/1"


@frozen
class SmallComponents:
    """Components of one shell that were removed for their size."""

    layer: int
    components: int
    triangles: int


@frozen
class ShellRow:
    """One shell as listed in the table; a report adds more entries."""

    layer: int  # 1 = outermost
    refractivity: float  # n - 1 at the surface
    ext: float  # n - 1 of the layers outside and inside
    int_: float = field(alias="int")
    temperature_k: float | None = None
    triangles: int = 0
    file: str = ""
    sha256: str = ""


@frozen
class PartOrigin:
    """The part's file that shells were written for."""

    file: str  # next to the table
    sha256: str
    source: str = ""  # name of the user's original file


@frozen
class AirStatement:
    """What is known of a scene's air; nothing where its file states nothing.

    Attributes
    ----------
    air : Air or None
        Ambient air, and the light.
    source : FieldSource or None
        The file behind it.
    rule : str or None
        How surfaces and layers were chosen.
    notes : dict of str
        What else the user or the program knew of the field, such as ``{"time": "snapshot"}``.
    part : PartOrigin or None
    shells : tuple of ShellRow
    small_components : tuple of SmallComponents
    """

    schema: str = SCHEMA
    length_unit: str = "mm"
    rule: str | None = None
    air: Air | None = None
    source: FieldSource | None = None
    notes: dict[str, str] = field(factory=dict)
    part: PartOrigin | None = None
    small_components: tuple[SmallComponents, ...] = ()
    shells: tuple[ShellRow, ...] = ()

    def at_wavelength(self, wavelength_nm: float) -> AirStatement:
        """The same air in other light; an InputError where the air is not stated."""
        factor = dispersion(self.air, wavelength_nm)
        assert self.air is not None
        rows = tuple(
            evolve(
                row,
                refractivity=factor * row.refractivity,
                ext=factor * row.ext,
                int=factor * row.int_,
            )
            for row in self.shells
        )
        return evolve(self, air=evolve(self.air, wavelength_nm=wavelength_nm), shells=rows)

    @property
    def wavelength_nm(self) -> float | None:
        """Wavelength of the light in vacuum, nm; None where it is not stated."""
        return None if self.air is None else self.air.wavelength_nm

    @property
    def heating_k(self) -> float | None:
        """Air of the innermost layer, which lies at the wall, over ambient air, K.

        None where that is not stated.
        """
        thinnest = min((row.int_ for row in self.shells), default=None)
        if self.air is None or thinnest is None or thinnest <= 0.0:
            return None
        heating = float(self.air.temperature(thinnest)) - float(self.air.temperature_k)
        return heating if heating > 0.0 else None

    @property
    def triangles(self) -> int:
        """Number of triangles of all shells."""
        return sum(row.triangles for row in self.shells)
