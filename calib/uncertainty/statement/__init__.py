"""What may be said of a tool point: how far, how probable, where, and whether it conforms.

One rule for every robot: the region holds the parameters and the largest misfit that the evidence
allows. The names below are the room's door.
"""

from calib.uncertainty.drift.memory import drift as drift
from calib.uncertainty.drift.memory import memory_p as memory_p
from calib.uncertainty.frames.other_frame import other_frame as other_frame
from calib.uncertainty.statement.applicability import proven_at as proven_at
from calib.uncertainty.statement.believe import believe as believe
from calib.uncertainty.statement.conformity import conformity as conformity
from calib.uncertainty.statement.distance import distance_radius as distance_radius
from calib.uncertainty.statement.distance import probability_within as probability_within
from calib.uncertainty.statement.instrument import InstrumentErrors as InstrumentErrors
from calib.uncertainty.statement.misfit import misfit as misfit
from calib.uncertainty.statement.shared import shared_errors as shared_errors
