"""Is a field good enough to trace light through it?"""

from iriftrace.field_check.balance import HeatBalance, heat_balance
from iriftrace.field_check.check import check_field
from iriftrace.field_check.cylinder import horizontal_cylinder_diameter
from iriftrace.field_check.edge import hottest_at_sides, share_through_open_sides
from iriftrace.field_check.finding import FieldCheck, Finding
from iriftrace.field_check.gradient import GradientErrors, gradient_errors
from iriftrace.field_check.wall_state import WallState, wall_state

__all__ = [
    "FieldCheck",
    "Finding",
    "GradientErrors",
    "HeatBalance",
    "WallState",
    "check_field",
    "gradient_errors",
    "heat_balance",
    "horizontal_cylinder_diameter",
    "hottest_at_sides",
    "share_through_open_sides",
    "wall_state",
]
