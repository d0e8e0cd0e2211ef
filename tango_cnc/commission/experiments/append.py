"""What one program has recorded is still in the file when the next one has begun."""

from __future__ import annotations

from ..experiment import Experiment, Ruling, Seen


def judge(seen: Seen) -> Ruling:
    """→ PASS where the file holds the records of both programs, or where there is no file."""
    if not seen.stored:
        return Ruling("PASS", "records come over the line, not through a file")
    if seen.kept is None:
        return Ruling("OPEN", "no second program was run, or nobody has looked into the file after it")
    if seen.kept:
        return Ruling("PASS", "the file holds the records of both programs")
    if seen.anew:
        return Ruling("PASS", "the second program has begun the file anew, as the profile says")
    return Ruling("FAIL", "the second program has overwritten the records of the first")


EXPERIMENT = Experiment(
    "append",
    4,
    "a program adds its records to their file, and does not begin it anew",
    "run two programs and look into the file of the records: it has two start marks",
    "have the file opened to append: A instead of O in extdev.ini (Siemens), ;A behind the name in output (Okuma), M_APPEND in the "
    "mask (Heidenhain). Where that cannot be, state records_file: anew: every program then asks for a copy of the file before the "
    "next one, and 'tango run' has read it by then",
    judge,
    rests=("output", "readings", "log", "mask", "records_file"),
    on=("port",),
)
