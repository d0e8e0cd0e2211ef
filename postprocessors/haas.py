"""Haas Classic and NGC: Fanuc's macro B, DPRNT fields that grow instead of losing digits, G31 no faster than 2500 mm/min.

Haas' page on G31 (silent miss, #5061 …, F in the block, no G41 or G42); operator's manual 96-8000 on DPRNT, POPEN and PCLOS, and
on axes by their letters (G54 X, Y, Z, A, B). An optical probe needs a second after it has been switched on.
"""

from ._base import Post, with_defaults
from ._macro_b import AT_ONCE, COMMON, OPTIONS, steps
from ._macro_b_text import Words
from ._remedies import HAAS

POST = Post(
    title="Haas",
    extension="nc",
    language="macro_b",
    links=("dnc", "file", "remote", "modbus"),
    tcp_off=("reset", "G49"),
    options=with_defaults(
        OPTIONS,
        probe_on="M59 P1134",
        probe_off="M69 P1134",
        positioning_feed=2000.0,
        axis_numbers={name: i for i, name in enumerate("XYZABC", 1)},
        must_be_off={4011: 51},
        wait="G103 P1",
    ),
    memory=512,
    remedies=HAAS,
    doubts=(
        AT_ONCE,
        *COMMON,
        "dynamic work offset G254 and tool centre point control G234 are off, and so are the settings for mirror images",
    ),
    **steps(Words(o_digits=5, dwell="G4 P{}.", settle="G4 P1.", fastest=2500.0)),
)
