"""What tests of its steps need of the diagnosis: candidates, shapes, rows, fields, the contest of names and shapes."""

from __future__ import annotations

from tango_cnc.diagnose import Finding, Remainder, Test
from tango_cnc.diagnose._candidates import Candidate, candidate, named, pattern
from tango_cnc.diagnose._catalogue import Chosen
from tango_cnc.diagnose._changing import over, unsteady
from tango_cnc.diagnose._contest import ALONE, MARGIN, SURE, Outcome, contest
from tango_cnc.diagnose._explain import Rough, values
from tango_cnc.diagnose._field import Field, Picked, begin, grown
from tango_cnc.diagnose._gain import add, held_out, measure, residual_maker, scattered
from tango_cnc.diagnose._names import akin, foreign, once
from tango_cnc.diagnose._plainer import plainer
from tango_cnc.diagnose._rest import rest
from tango_cnc.diagnose._richer import richer
from tango_cnc.diagnose._rows import Rows, alike, rows
from tango_cnc.diagnose._scatter import Scatter, scatter, uneven
from tango_cnc.diagnose._seen import left_over, parted
from tango_cnc.diagnose._shapes import recognised
from tango_cnc.diagnose._smooth import Kernel, forms, scaled
from tango_cnc.diagnose._space import Beside, best_noise, level, space
from tango_cnc.diagnose._together import together
from tango_cnc.diagnose._variances import left
from tango_cnc.terms._shape import BEYOND, EVEN, LEGENDRE, SIDE, WAVES, Factor, Form, form_of, weights

__all__ = [
    "ALONE",
    "BEYOND",
    "EVEN",
    "LEGENDRE",
    "MARGIN",
    "SIDE",
    "SURE",
    "WAVES",
    "Beside",
    "Candidate",
    "Chosen",
    "Factor",
    "Field",
    "Finding",
    "Form",
    "Kernel",
    "Outcome",
    "Picked",
    "Remainder",
    "Rough",
    "Rows",
    "Scatter",
    "Test",
    "add",
    "akin",
    "alike",
    "begin",
    "best_noise",
    "candidate",
    "contest",
    "foreign",
    "form_of",
    "forms",
    "grown",
    "held_out",
    "left",
    "left_over",
    "level",
    "measure",
    "named",
    "once",
    "over",
    "parted",
    "pattern",
    "plainer",
    "recognised",
    "residual_maker",
    "rest",
    "richer",
    "rows",
    "scaled",
    "scatter",
    "scattered",
    "space",
    "together",
    "uneven",
    "unsteady",
    "values",
    "weights",
]
