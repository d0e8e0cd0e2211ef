"""Fanuc 0i, 16i, 18i, 21i, 30i with custom macro B (B-63534EN, B-63944EN; docs/dialects.md says which facts are confirmed)."""

from ._base import Post, settled
from ._macro_b import AT_ONCE, COMMON, OPTIONS, steps
from ._macro_b_text import Words
from ._remedies import FANUC

POST = Post(
    title="Fanuc macro B",
    extension="nc",
    language="macro_b",
    links=("dnc", "file", "remote", "modbus"),
    tcp_off=("reset", "G49"),
    options=settled(OPTIONS, "wait"),
    memory=512,
    remedies=FANUC,
    doubts=(AT_ONCE, *COMMON),
    **steps(Words()),
)
