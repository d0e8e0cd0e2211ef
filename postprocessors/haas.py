"""Haas Classic and NGC: Fanuc's macro B, DPRNT fields that grow instead of losing digits, G31 no faster than 2500 mm/min.

Haas' page on G31 (silent miss, #5061 …, F in the block, no G41 or G42); operator's manual 96-8000 on DPRNT, POPEN and PCLOS.
"""

from ._base import Post, with_defaults
from ._macro_b import DOUBTS, OPTIONS, steps
from ._macro_b_text import Words

POST = Post(
    title="Haas",
    extension="nc",
    options=with_defaults(OPTIONS, probe_on="M59 P1134", probe_off="M69 P1134", positioning_feed=2000.0),
    doubts=(*DOUBTS, "dynamic work offset G254 and tool centre point control G234 are off"),
    **steps(Words(o_digits=5)),
)
