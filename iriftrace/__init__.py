"""iriftrace: how hot air around a part displaces what a camera sees of it.

The names of ``__init__.pyi`` are imported when they are first used, so that ``import iriftrace``
needs neither Mitsuba nor VTK.
"""

from __future__ import annotations

from typing import Any

import lazy_loader

from iriftrace.core.html import draw_with

_attribute, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__all__ += ["__version__"]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        # Looking it up takes longer than Python's own start.
        from importlib.metadata import version

        return version("iriftrace")
    return _attribute(name)


def _framed(value: object, numbers: dict[str, Any] | None) -> str:
    """The page of a value for notebooks."""
    from iriftrace.figures.page import frame
    from iriftrace.figures.pictures import picture_of

    return frame(picture_of(value, numbers))


draw_with(_framed)
