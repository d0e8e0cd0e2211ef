"""Mistakes of `make mutants` that change nothing, each with the reason: the tool counts them apart, and no test is asked.

(file, what stands there, what the mistake makes of it) → why nothing is different. A test refuses one
that can be made nowhere, or at two places.
"""

from __future__ import annotations

NOTHING: dict[tuple[str, str, str], str] = {
    ("tango_cnc/plan/preload.py", "abs(turned(axis, change)) > 1e-9", "(abs(turned(axis, change))) >= (1e-09)"): (
        "a computed turn: equal to a limit by chance alone"
    ),
    ("tango_cnc/check/collision.py", "way * math.cos(LEAN) > depth", "(way * math.cos(LEAN)) >= (depth)"): (
        "a computed way: equal to a limit by chance alone"
    ),
    ("tango_cnc/link/wire.py", "room <= 0", "(room) < (0)"): "without room it would send no bytes, which is nothing, too",
    ("tango_cnc/check/bodies.py", "tip + high * up + around", "(tip + high * up) - (around)"): "the same corners in another order",
    ("tango_cnc/check/bodies.py", "tip + low * up + around", "(tip + low * up) - (around)"): "the same corners in another order",
    ("tango_cnc/plan/sweep.py", "tip + height * up + radius * around", "(tip + height * up) - (radius * around)"): (
        "the same corners in another order"
    ),
    (
        "tango_cnc/plan/guard.py",
        "near.any() or (motion.sum(axis=1) < FINE).any()",
        "(near.any() and (motion.sum(axis=1) < FINE).any())",
    ): "what is too near stays so in every smaller box: the search only takes longer",
    ("tango_cnc/plan/guard.py", "motion.sum(axis=1) < FINE", "(motion.sum(axis=1)) <= (FINE)"): (
        "a computed way: equal to a limit by chance alone"
    ),
    (
        "tango_cnc/plan/guard.py",
        "looked > MOST",
        "(looked) >= (MOST)",
    ): "one box more or less of 20 000: no proof either way",
    ("tango_cnc/check/collision.py", "probe.nose_radius > probe.body_radius", "(probe.nose_radius) >= (probe.body_radius)"): (
        "a nose as thick as the body is a part of it"
    ),
    ("tango_cnc/check/collision.py", "down < clear + GAP", "(down) <= (clear + GAP)"): (
        "a computed way: equal to a limit by chance alone"
    ),
    ("tango_cnc/check/collision.py", "cosine < SHANK", "(cosine) <= (SHANK)"): (
        "a computed angle: equal to a limit by chance alone"
    ),
    (
        "tango_cnc/check/solid.py",
        "base + obstacle.radius * rim(axis, SIDES, 0.5)",
        "(base) - (obstacle.radius * rim(axis, SIDES, 0.5))",
    ): "the same corners in another order: of sixteen each has one opposite",
    ("tango_cnc/plan/guard.py", "len(rows) >= CHUNK", "(not (len(rows) >= CHUNK))"): (
        "moves are proven one at a time: the same, more slowly"
    ),
    ("tango_cnc/check/apart.py", "corner.T / size", "(corner.T) * (size)"): "the nearest direction is the same in every unit",
    ("tango_cnc/readback/languages/grbl.py", "abs(length - self._length) > ALIKE", "(abs(length - self._length)) >= (ALIKE)"): (
        "a computed length: equal to a limit by chance alone"
    ),
    ("tango_cnc/link/transport/_file.py", "len(START) - 1", "(len(START)) + (1)"): (
        "two bytes more of a piece that was searched already: a mark that is whole in it has been found"
    ),
    ("tango_cnc/check/solid.py", "3 - np.sqrt(5)", "(3) + (np.sqrt(5))"): "the same spiral the other way round",
    ("tango_cnc/link/protocols/grbl.py", "self._since >= POLL", "(self._since) > (POLL)"): (
        "a time that was added up: equal to a limit by chance alone"
    ),
    ("tango_cnc/check/collision.py", "normal @ body.normal.T >= ALIKE", "(normal @ body.normal.T) > (ALIKE)"): (
        "a computed angle: equal to a limit by chance alone"
    ),
    ("tango_cnc/readback/walk.py", "gap < AIR", "(gap) <= (AIR)"): "a computed distance: equal to a limit by chance alone",
}
