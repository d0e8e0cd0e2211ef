"""Mitsubishi M70, M80, M700V, M800: Fanuc's macro B. G31 is unmodal and its F must stand in the block (M700V manual, p. 547).

With the skip signal already on, G31 is complete at once; without contact it ends at its target and says nothing. A G31 under
radius compensation is alarm P608, one without feed P603.
"""

from ._base import Post, with_defaults
from ._macro_b import COMMON, OPTIONS, READS_SO, steps
from ._macro_b_text import Words
from ._remedies import MITSUBISHI

POST = Post(
    title="Mitsubishi M70 and M80",
    extension="nc",
    language="macro_b",
    links=("dnc", "file", "remote", "modbus"),
    options=with_defaults(OPTIONS, must_be_off={4011: 51, 4018: 16, 4019: 51.1}),
    memory=512,
    remedies=MITSUBISHI,
    doubts=(READS_SO, *COMMON, "#5021, #5041 and #5061 and DPRNT are those of Fanuc", "IF and THEN stand in one block"),
    **steps(Words()),
)
