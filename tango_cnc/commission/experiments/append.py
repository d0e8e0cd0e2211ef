"""What one program has recorded is still in the file when the next one has begun."""

from __future__ import annotations

from ..experiment import Experiment, Seen, Verdict


def judge(seen: Seen) -> Verdict:
    """→ PASS where the file holds the records of both programs, or where there is no file."""
    if not seen.stored:
        return Verdict("PASS", "records come over the line, not through a file")
    if seen.kept is None:
        return Verdict("OPEN", "no second program was run, or nobody has looked into the file after it")
    if seen.kept:
        return Verdict("PASS", "the file holds the records of both programs")
    return Verdict("FAIL", "the second program has overwritten the records of the first")


EXPERIMENT = Experiment(
    "append",
    4,
    "a program adds its records to their file, and does not begin it anew",
    "run two programs and look into the file of the records: it has two start marks",
    "have the file opened to append: A instead of O in extdev.ini (Siemens), ;A behind the name in output (Okuma), M_APPEND in the "
    "mask (Heidenhain); else copy the file before each program, and keep the link connected while one runs",
    judge,
    rests=("output", "readings", "log", "mask"),
    on=("port",),
)
