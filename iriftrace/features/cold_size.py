"""Sizes of a hot part's features at the temperature of its drawing, and their uncertainty."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from attrs import evolve, frozen

from iriftrace.features.choice import on_region
from iriftrace.features.fit import fit_feature
from iriftrace.features.fitted import FittedFeature
from iriftrace.features.quantity import AngleAtReference, Quantity, SizeAtReference
from iriftrace.features.relations import Relation, relations
from iriftrace.part.growth import Growth
from iriftrace.part.part import Part

K = 2
"""Coverage factor of the expanded uncertainty."""

_PLACES = np.full((3, 3), 1.0 / 6.0) + np.eye(3) / 2.0
"""Shares of a triangle's corners at three places, whose mean is exact for quadratic functions
(Strang and Fix, An Analysis of the Finite Element Method, 1973, table 4.1)."""


@frozen
class ColdSizes:
    """Converts sizes of an expanded part to the temperature of its drawing.

    A size is divided by the growth of the same feature of the model: its size hot over that cold,
    fitted to the surfaces of the hot part and of its drawing.
    """

    part: Part
    u_expansion: float | None = None  # relative standard uncertainty of the thermal expansion
    u_temperature_k: float | None = None  # standard uncertainty of the part's temperature, K

    def of_features(
        self, features: Sequence[FittedFeature], true: str
    ) -> tuple[FittedFeature, ...]:
        """Features with `Quantity.at_reference` of their sizes in the cloud `true`.

        They do not change if the part has not grown, or a feature has no size.
        """
        growth = self.part.growth
        if growth is None:
            return tuple(features)
        return tuple(
            evolve(each, size=self._cold(growth, each.size, true, self._model(growth, each).size))
            for each in features
        )

    def of_relations(
        self, related: Sequence[Relation], features: Sequence[FittedFeature], true: str
    ) -> tuple[Relation, ...]:
        """The same for the `relations` of features; an angle changes as much as the model's."""
        growth = self.part.growth
        if growth is None:
            return tuple(related)
        planes = [self._model(growth, each) for each in features if each.kind == "plane"]
        model = {each.regions: each.value for each in relations(planes)}
        return tuple(
            evolve(each, value=self._cold(growth, each.value, true, model[each.regions]))
            if each.regions in model
            else each
            for each in related
        )

    def _model(self, growth: Growth, feature: FittedFeature) -> FittedFeature:
        """The same feature of the model, hot and cold."""
        part, kind, region = self.part, feature.kind, feature.region
        cold = part.vertices / growth.factor if part.drawing is None else part.drawing
        chosen = on_region(region, np.arange(len(part.faces)), part)
        faces, weights = part.faces[chosen], np.repeat(part.face_areas[chosen], 3)
        clouds = {"hot": part.vertices, "cold": cold}
        fits = {
            name: fit_feature((_PLACES @ vertices[faces]).reshape(-1, 3), kind, weights)
            for name, vertices in clouds.items()
        }
        return FittedFeature(kind, region, 0, fits)

    def _cold(self, growth: Growth, value: Quantity, true: str, model: Quantity) -> Quantity:
        """A value of the part at the temperature of the drawing, by that of the model."""
        size, hot, cold = value.by_cloud[true], model.by_cloud["hot"], model.by_cloud["cold"]
        if size is None or hot is None or not cold or value.unit != model.unit:
            return value
        if value.unit == "deg":
            return evolve(
                value, at_reference=AngleAtReference(growth.reference_k, size - hot + cold)
            )
        factor = hot / cold
        u = None
        if self.u_expansion is not None and self.u_temperature_k is not None:
            # Uncertainty of size / (1 + strain) to first order, both independent.
            terms = (factor - 1.0) * self.u_expansion, growth.expansion * self.u_temperature_k
            u = K * abs(size) / factor**2 * float(np.hypot(*terms))
        holds_at_k = growth.reference_k + (factor - 1.0) / growth.expansion
        reference = SizeAtReference(growth.reference_k, holds_at_k, size / factor, u)
        return evolve(value, at_reference=reference)
