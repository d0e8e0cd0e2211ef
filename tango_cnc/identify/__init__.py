"""Which unknowns a plan can see, which it cannot, and which combination that is, in words.

Columns of the Jacobian at the nominal contacts are taken in order of preference; one that lies in the span of those before
it moves every touch exactly as they do and is left out. What a subset word such as S3 means for a topology is decided the
same way on a rich plan: random poses over the whole travel, every direction, a scale bar.
"""

from .rank import CLEAR, columns, condition_number, independent, scaled_condition_number
from .selection import SUBSETS, Selection, never_seen, rich_plan, select, subset_terms
from .words import describe, summary

__all__ = [
    "CLEAR",
    "SUBSETS",
    "Selection",
    "columns",
    "condition_number",
    "describe",
    "independent",
    "never_seen",
    "rich_plan",
    "scaled_condition_number",
    "select",
    "subset_terms",
    "summary",
]
