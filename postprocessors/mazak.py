"""Mazak with EIA programs (Matrix, Smooth): the same family as Mitsubishi, Fanuc's macro B; Mazatrol itself is not written."""

from ._base import Post, with_defaults
from ._macro_b import DOUBTS, OPTIONS, steps
from ._macro_b_text import Words
from ._remedies import MAZAK

POST = Post(
    title="Mazak EIA",
    extension="EIA",
    language="macro_b",
    links=("dnc", "file", "remote", "modbus"),
    options=with_defaults(OPTIONS, must_be_off={4011: 51, 4018: 16, 4019: 51.1}),
    memory=512,
    remedies=MAZAK,
    doubts=(*DOUBTS, "#5021, #5041 and #5061 are those of Fanuc", "DPRNT goes to the port that parameters of the control choose"),
    **steps(Words()),
)
