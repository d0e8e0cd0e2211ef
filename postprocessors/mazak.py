"""Mazak with EIA programs (Matrix, Smooth): the same family as Mitsubishi, Fanuc's macro B; Mazatrol itself is not written."""

from ._base import Post
from ._macro_b import DOUBTS, OPTIONS, steps
from ._macro_b_text import Words

POST = Post(
    title="Mazak EIA",
    extension="EIA",
    options=OPTIONS,
    doubts=(*DOUBTS, "#5021, #5041 and #5061 are those of Fanuc", "DPRNT goes to the port that parameters of the control choose"),
    **steps(Words()),
)
