"""The labels of a Klartext program, which do the work, and the Q parameters that they share with the blocks before M30."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from tango_cnc.records import OFF

from ._base import Job, early_distance, number, search_distance
from ._common import IN_THE_AIR

ASIDE = 1.0  # mm beside the line of a measuring move at which a result is not one in machine coordinates
GUARDED, MEASURING, RECORD, FINDING, CYCLE, GATE = 1, 2, 3, 4, 5, 6  # labels
UNMET = 90
MET, DEAD, ELSEWHERE, TURNED, TABLE, DISAGREES, ASTRAY, UNTOUCHED, SCALED = 91, 92, 93, 94, 95, 96, 97, 98, 99
STOPS = {
    MET: "PROBE MET SOMETHING OR A FRAME IS ROTATED MIRRORED OR SCALED",
    UNMET: IN_THE_AIR,
    DEAD: "NO CONTACT. IS THE PROBE ALIVE",
    ELSEWHERE: "RESULT IS NOT IN MACHINE COORDINATES",
    TURNED: "ROTARY AXIS NOT IN PLACE",
    UNTOUCHED: "STYLUS WAS NOT TOUCHED",
    SCALED: "A SCALING OR MIRROR IMAGE IS ON. CYCLE 8 11 OR 26",
}
CANCELS = (  # datum shift, mirror image, rotation, scaling
    *("CYCL DEF 7.0 DATUM SHIFT", "CYCL DEF 7.1 X+0.0", "CYCL DEF 7.2 Y+0.0", "CYCL DEF 7.3 Z+0.0"),
    *("CYCL DEF 8.0 MIRROR IMAGE", "CYCL DEF 8.1"),
    *("CYCL DEF 10.0 ROTATION", "CYCL DEF 10.1 ROT+0"),
    *("CYCL DEF 11.0 SCALING", "CYCL DEF 11.1 SCL 1"),
)
UNSCALED = tuple(  # whether cycle 8 or 26 has left an axis mirrored or scaled, which a measuring move would go by: asked, as the
    line  # texts that cancel them are not sure
    for asked, right in (("NR3", 0), *((f"NR4 IDX{number}", 1) for number in (1, 2, 3)))
    for line in (f"FN 18: SYSREAD Q35 = ID210 {asked}", f"FN 10: IF +Q35 NE +{right} GOTO LBL {SCALED}")
)
TARGET = {"X": "Q21", "Y": "Q22", "Z": "Q23"}
START = {"X": "Q24", "Y": "Q25", "Z": "Q26"}
FEED, WAY, HIT, FLAG, MISSES = "Q27", "Q34", "Q41", "Q46", "Q47"
NOW = {"X": "Q31", "Y": "Q32", "Z": "Q33"}
FOUND = {"X": "Q41", "Y": "Q42", "Z": "Q43"}  # and Q44: −1 without contact
NONE = "Q44"
ROTARY = ("Q51", "Q52", "Q53")
TOUCH, SPINDLE, SUM = "Q56", "Q57", "Q58"


def guarded(job: Job) -> Iterator[str]:
    """Probes to Q21 Q22 Q23 and must meet nothing. Less than 1 µm is no way to go. The axes stand: every move is waited for."""
    yield f"LBL {GUARDED} ; GUARDED MOVE TO Q21 Q22 Q23"
    for name in "XYZ":
        yield reading(job, NOW[name], name)
        yield f"{NOW[name]} = {TARGET[name]} - {NOW[name]}"
    yield f"{WAY} = SQRT ( {NOW['X']} ^ 2 + {NOW['Y']} ^ 2 + {NOW['Z']} ^ 2 )"
    yield f"FN 12: IF +{WAY} LT +0.001 GOTO LBL 11"
    yield from _tch_probe(job.options["distance"], feed_text(job.options["positioning_feed"]), "+0")
    yield "FN 20: WAIT FOR SYNC"
    yield "Q35 = 0"
    for name in "XYZ":
        yield reading(job, "Q36", name)
        yield f"Q35 = Q35 + ABS ( {TARGET[name]} - Q36 )"
    yield f"FN 11: IF +Q35 GT +{job.options['tolerance']:.4f} GOTO LBL {MET}"
    yield f"FN 11: IF +{NONE} GT -0.5 GOTO LBL {UNMET}"
    yield "LBL 11"
    yield "LBL 0"


def measuring(job: Job, label: int = MEASURING, then: Iterable[str] = (), last: Iterable[str] = ()) -> Iterator[str]:
    """Probes from Q24 Q25 Q26 to Q21 Q22 Q23; puts the flag into Q46, the contact into Q41 Q42 Q43, rotary axes into Q51 and on.

    `label` FINDING is the first move of a double touch: only its feed and the numbers of the places that it jumps to differ.
    `then`: what is done besides where there was contact; `last`: in any case.
    """
    yield f"LBL {label} ; MEASURING MOVE FROM Q24 Q25 Q26 TO Q21 Q22 Q23"
    yield from way()
    yield from _tch_probe(job.options["distance"], feed_text(job.plan.strategy.approach.feed), f"+{OFF:.4f}")
    yield "FN 20: WAIT FOR SYNC"
    yield from turned(job)
    yield f"{FLAG} = 0"
    missed, early, done = (10 * label + i for i in (1, 2, 3))
    yield f"FN 12: IF +{NONE} LT -0.5 GOTO LBL {missed}"
    yield from then
    yield from on_its_line(job, FOUND, ELSEWHERE)
    yield f"FN 11: IF +Q36 GT +{search_distance(job.plan) - job.options['tolerance']:.4f} GOTO LBL {missed}"
    yield f"{FLAG} = 1"
    yield f"FN 11: IF +Q35 GT +{early_distance(job.plan):.4f} GOTO LBL {early}"
    yield f"{FLAG} = 2"
    yield f"LBL {early}"
    yield f"{MISSES} = 0"
    yield f"FN 9: IF +0 EQU +0 GOTO LBL {done}"
    yield f"LBL {missed}"
    yield f"{MISSES} = {MISSES} + 1"
    for name in "XYZ":
        yield f"{FOUND[name]} = {TARGET[name]}"
    yield f"FN 11: IF +{MISSES} GT +{job.options['misses'] - 0.5:.1f} GOTO LBL {DEAD}"
    yield f"LBL {done}"
    yield from last
    yield "LBL 0"


def way() -> Iterator[str]:
    """Q31 Q32 Q33 and their length Q34: from Q24 Q25 Q26 to Q21 Q22 Q23."""
    for name in "XYZ":
        yield f"{NOW[name]} = {TARGET[name]} - {START[name]}"
    yield f"{WAY} = SQRT ( {NOW['X']} ^ 2 + {NOW['Y']} ^ 2 + {NOW['Z']} ^ 2 )"


def turned(job: Job) -> Iterator[str]:
    """Rotary axes into Q51 and on."""
    for name, parameter in zip(job.machine.rotary, ROTARY, strict=False):
        yield reading(job, parameter, name)


def on_its_line(job: Job, place: Mapping[str, str], label: int, aside: float = ASIDE) -> Iterator[str]:
    """{X Y Z: parameter} of a place → Q35 its distance from Q24 Q25 Q26, Q36 that along the way; jumps if beside it."""
    went = {name: f"( {place[name]} - {START[name]} )" for name in "XYZ"}
    yield f"Q35 = SQRT ( {' + '.join(f'{w} ^ 2' for w in went.values())} )"
    yield f"Q36 = ( {' + '.join(f'{w} * {NOW[name]}' for name, w in went.items())} ) / {WAY}"
    yield f"FN 11: IF +Q35 GT +{search_distance(job.plan) + ASIDE:.4f} GOTO LBL {label}"
    yield "Q37 = ABS ( Q35 ^ 2 - Q36 ^ 2 )"
    yield f"FN 11: IF +Q37 GT +{aside**2:.4f} GOTO LBL {label}"


def _tch_probe(word: str, feed: str, back_by: str) -> Iterator[str]:
    """In the direction of Q31 Q32 Q33 by Q34; results in Q41 … Q44 in machine coordinates."""
    yield "TCH PROBE 4.0 MEASURING IN 3-D"
    yield f"TCH PROBE 4.1 {HIT}"
    yield f"TCH PROBE 4.2 IX+{NOW['X']} IY+{NOW['Y']} IZ+{NOW['Z']}"
    yield f"TCH PROBE 4.3 {word}+{WAY} F{feed} MB{back_by} REFERENCE SYSTEM: 1"


def record_text(job: Job) -> Iterator[str]:
    """One line: touch Q56, flag, machine coordinates, spindle Q57, their sum."""
    places = {**FOUND, **dict(zip(job.machine.rotary, ROTARY, strict=False)), "S": SPINDLE}
    yield f"LBL {RECORD} ; RECORD OF TOUCH Q56 WITH SPINDLE AT Q57"
    yield f"{SUM} = {' + '.join(places.values())}"
    yield f"QS2 = TOCHAR ( DAT+{TOUCH} DECIMALS0 )"
    yield f"QS3 = TOCHAR ( DAT+{FLAG} DECIMALS0 )"
    yield declared("P")
    yield declared(" H", "QS4")
    yield "QS1 = QS1 || QS2 || QS4 || QS3"
    for letter, parameter in {**places, "K": SUM}.items():
        yield declared(f" {letter}", "QS3")
        yield f"QS2 = TOCHAR ( DAT+{parameter} DECIMALS4 )"
        yield "QS1 = QS1 || QS3 || QS2"
    yield printed(job)
    yield "LBL 0"


def declared(text: str, parameter: str = "QS1") -> str:
    """text → the block that puts it into a string parameter: in a formula the manuals have string parameters only."""
    return f'DECLARE STRING {parameter} = "{text}"'


def printed(job: Job) -> str:
    """→ the block that prints QS1."""
    return f"FN 16: F-PRINT {job.options['mask']} / {job.options['output']}"


def reading(job: Job, parameter: str, name: str, frame: str = "ID240") -> str:
    """→ the block that puts an axis' machine position (ID270: that of the ball in the program's frame) into a parameter."""
    stated = job.options["axis_numbers"]
    which = stated[name] if stated else 1 + "XYZABC".index(name)
    return f"FN 18: SYSREAD {parameter} = {frame} NR{8 if frame == 'ID240' else 1} IDX{which}"


def feed_text(value: float) -> str:
    """mm/min → '180' or '999.5'."""
    return number(value, 3).rstrip(".")
