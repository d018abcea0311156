"""Options of photographs, for Python and for commands."""

from __future__ import annotations

from typing import Literal

AirOfPicture = Literal["hot", "cold", "both"]

HOT: AirOfPicture = "hot"

EMISSIVITY = 0.8
"""Of oxidised steel, as most that is forged or hardened."""

AMBIENT = 0.05
"""Diffuse light of a room, W/(m^2 nm)."""

SAMPLES = 3
