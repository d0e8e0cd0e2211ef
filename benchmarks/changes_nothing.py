"""Mistakes of `make mutants` that change nothing, each with the reason: the tool counts them apart, and no test is asked.

(file, what stands there, what the mistake makes of it) → why nothing is different. A test refuses one
that can be made nowhere, or at two places.
"""

from __future__ import annotations

NOTHING: dict[tuple[str, str, str], str] = {
    ("tango_cnc/link/wire.py", "room <= 0", "(room) < (0)"): "without room it would send no bytes, which is nothing, too",
    ("tango_cnc/check/apart.py", "corner.T / size", "(corner.T) * (size)"): "the nearest direction is the same in every unit",
    ("tango_cnc/readback/walk.py", "gap < AIR", "(gap) <= (AIR)"): "a computed distance: equal to a limit by chance alone",
}
