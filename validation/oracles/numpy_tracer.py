"""A scene's folder in the NumPy tracer, read by nothing but trimesh and the XML's own values."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import trimesh

from iriftrace.tracing.facets import FacetSurface, FacetTracer


def numpy_tracer(xml: Path) -> FacetTracer:
    """The tracer of all shells of a scene, and of its part."""
    shells, part = [], []
    for shape in ElementTree.parse(xml).getroot().iter("shape"):
        values = {child.get("name"): child.get("value") for child in shape.iter()}
        mesh = trimesh.load(xml.parent / values["filename"], process=False)
        triangles = np.asarray(mesh.vertices, dtype=np.float64)[mesh.faces]
        if shape.get("id") == "part":
            part.append(FacetSurface(triangles))
        else:
            index = float(values.get("ext_ior", 1)), float(values.get("int_ior", 1))
            shells.append(FacetSurface(triangles, index))
    return FacetTracer(shells, part)
