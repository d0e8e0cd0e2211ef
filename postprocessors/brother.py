"""Brother Speedio with Fanuc-like macros; Renishaw's programs are in the O8xxx range there (G65 P8832 switches the probe on)."""

from ._base import Post, with_defaults
from ._macro_b import DOUBTS, OPTIONS, steps
from ._macro_b_text import Words
from ._remedies import BROTHER

POST = Post(
    title="Brother Speedio",
    extension="NC",
    language="macro_b",
    links=("dnc", "file", "remote", "modbus"),
    options=with_defaults(OPTIONS, program_number=7700, probe_on="G65 P8832", probe_off="G65 P8833"),
    memory=512,
    remedies=BROTHER,
    doubts=(*DOUBTS, "G31, #5021, #5041, #5061 and DPRNT are those of Fanuc", "IF and THEN stand in one block"),
    **steps(Words()),
)
