"""Sizes of a hot part's features at the temperature of its drawing, and their uncertainty."""

from __future__ import annotations

import numpy as np
from attrs import frozen

from iriftrace.core.plain import JsonObject
from iriftrace.features.fit import fit_feature
from iriftrace.features.relations import relations, value_key
from iriftrace.features.table import feature_row
from iriftrace.part.growth import Growth
from iriftrace.part.part import Part

Rows = list[JsonObject]

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

    def add_to_features(self, rows: Rows, true: str) -> Rows:
        """Rows of `feature_table` with ``at_reference`` of their sizes in the cloud `true`.

        ``temperature_k`` of the drawing, ``size_mm`` there, ``expansion_uncertainty_mm`` (k = 2) by
        the standard uncertainties of expansion and temperature, None where one is not given; and
        ``holds_at_k``, the temperature of a part that is equally hot everywhere and grows as much.
        Rows do not change if the part has not grown, or a feature has no size.
        """
        growth = self.part.growth
        if growth is None:
            return rows
        return [
            row | self._reference(growth, row["size_mm"][true], self._model(growth, row)["size_mm"])
            for row in rows
        ]

    def add_to_relations(self, rows: Rows, features: Rows, true: str) -> Rows:
        """The same for the `relations` of features; for an angle ``angle_deg`` without uncertainty.

        An angle changes by the same amount as the model's.
        """
        growth = self.part.growth
        if growth is None:
            return rows
        planes = [self._model(growth, row) for row in features if row["kind"] == "plane"]
        model = {tuple(row["regions"]): row for row in relations(planes)}
        found = []
        for row in rows:
            same, key = model.get(tuple(row["regions"])), value_key(row)
            if same is None or key not in same:
                found.append(row)
            elif key == "size_mm":
                found.append(row | self._reference(growth, row[key][true], same[key]))
            else:
                cold = row[key][true] - same[key]["hot"] + same[key]["cold"]
                state = {"temperature_k": growth.reference_k, key: cold}
                found.append(row | {"at_reference": state})
        return found

    def _model(self, growth: Growth, row: JsonObject) -> JsonObject:
        """Row of the same feature of the model, hot and cold."""
        part, kind, region = self.part, row["kind"], row["region"]
        cold = part.vertices / growth.factor if part.drawing is None else part.drawing
        chosen = np.ones(len(part.faces), dtype=bool)
        if region is not None:
            chosen = part.region_of_face == part.region_names.index(region)
        faces, weights = part.faces[chosen], np.repeat(part.face_areas[chosen], 3)
        clouds = {"hot": part.vertices, "cold": cold}
        fits = {
            name: fit_feature((_PLACES @ vertices[faces]).reshape(-1, 3), kind, weights)
            for name, vertices in clouds.items()
        }
        return feature_row(kind, region, len(weights), fits)

    def _reference(
        self, growth: Growth, size: float | None, model: dict[str, float | None]
    ) -> JsonObject:
        hot, cold = model["hot"], model["cold"]
        if size is None or hot is None or not cold:
            return {}
        factor = hot / cold
        u = None
        if self.u_expansion is not None and self.u_temperature_k is not None:
            # Uncertainty of size / (1 + strain) to first order, both independent.
            terms = (factor - 1.0) * self.u_expansion, growth.expansion * self.u_temperature_k
            u = K * abs(size) / factor**2 * float(np.hypot(*terms))
        return {
            "at_reference": {
                "temperature_k": growth.reference_k,
                "holds_at_k": growth.reference_k + (factor - 1.0) / growth.expansion,
                "size_mm": size / factor,
                "expansion_uncertainty_mm": u,
            }
        }
