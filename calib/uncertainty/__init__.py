"""Uncertainty of the identified numbers and of the tool point: statements, and their proof.

The names below are the room's door; functions stand here before the modules of the same name.
"""

from calib.uncertainty.adaptive import adaptive as adaptive
from calib.uncertainty.bootstrap import bootstrap as bootstrap
from calib.uncertainty.budget import RowNoise as RowNoise
from calib.uncertainty.budget import budget as budget
from calib.uncertainty.conformal import conformal as conformal
from calib.uncertainty.discrepancy import discrepancy as discrepancy
from calib.uncertainty.held_out import held_out as held_out
from calib.uncertainty.judgement import judge as judge
from calib.uncertainty.monte_carlo import distance_spread as distance_spread
from calib.uncertainty.monte_carlo import point_spread as point_spread
from calib.uncertainty.refit import freeze as freeze
from calib.uncertainty.refit import refit as refit
from calib.uncertainty.regions import coverage_factor as coverage_factor
from calib.uncertainty.regions import ellipsoid as ellipsoid
from calib.uncertainty.regions import expanded as expanded
from calib.uncertainty.regions import inside as inside
from calib.uncertainty.tool_map import tool_map as tool_map
from calib.uncertainty.tool_point import propagate as propagate
from calib.uncertainty.tool_point import tool_statement as tool_statement
from calib.uncertainty.trust import trust as trust
from calib.uncertainty.type_a import type_a as type_a
from calib.uncertainty.type_b import common_inputs as common_inputs
from calib.uncertainty.validation import first_order as first_order
from calib.uncertainty.validation import validate as validate
