"""The common options of commands with many, which ``--help`` lists; ``--help-all`` lists all."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from cyclopts.help import DefaultFormatter

if TYPE_CHECKING:
    from cyclopts.help import HelpPanel
    from rich.console import Console, ConsoleOptions

MOST = 20
"""Largest number of inputs and options that ``--help`` lists."""

_FIELD_AND_PART = "field part output ambient pressure time field-length-unit length-unit expansion"
_COMMON = {
    "scene": f"{_FIELD_AND_PART} hot-temperature member layers focal-length calibration pixel-size "
    "focus origin target pose second",
    "shells": f"{_FIELD_AND_PART} hot-temperature wavelength array quantity temperature-unit "
    "field-transform isosurfaces layers index-range rule part-transform",
    "field check": f"{_FIELD_AND_PART} hot-temperature wall-temperature region-temperature "
    "transition diameter origin known layers field-transform part-transform",
    "field simulate": "part output length-unit expansion hot-temperature wall-temperature "
    "wall-temperature-from region-temperature ambient pressure resolution symmetry body floor "
    "end-time processes draught draughts draught-from vary",
    "photograph": "scene output air temperature emissivity blocker-temperature print print-width "
    "print-to-world ambient light irradiance lines period steps gray exposure samples noise define",
    "sweep": "scenes output azimuth elevation target stand-off semi-axes fibonacci poses turntable "
    "length-unit robot focal-length define engine export surface scheduler workers",
    "plan": "sweep statistic region criterion outside min-hits min-coverage top views "
    "max-displacement max-incidence refine evaluations output pairs system angle feature "
    "save convention",
}

COMMON: Mapping[str, frozenset[str]] = {
    command: frozenset(names.split()) for command, names in _COMMON.items()
}
"""Names of inputs and options, without hyphens before them, by command."""


class CommonOptions(DefaultFormatter):
    """Layout of the help with only the options of these names."""

    def __init__(self, names: frozenset[str]) -> None:
        super().__init__()
        self.names = names

    def __call__(self, console: Console, options: ConsoleOptions, panel: HelpPanel) -> None:
        """Print a group of options, if one is common."""
        entries = [
            entry
            for entry in panel.entries
            if self.names & {name.lstrip("-").lower() for name in entry.all_options}
            or (entry.positional_label or "").lower() in self.names
        ]
        super().__call__(console, options, panel.copy(entries=entries))
