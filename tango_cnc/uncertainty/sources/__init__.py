"""What may make a reading uncertain: one file a source, named after it (docs/uncertainty.md).

A file `<source>.py` holds `TEXT` (for people), `REPEATS` (a repetition of the same program draws it anew, so that repeated
cycles show it), `SHARED` (one and the same draw acts on whatever else is measured with this probe and bar) and

    def factor(scene: Scene, *, std: float, …) -> tuple[Array, Law]

Its keyword arguments are the keys that a budget may give beside `source`; one without a default is required. Lengths are
mm, angles deg, times s. The result is (n + m, k) mm: deviation of the n gaps and m known distances per unit-variance ξ.
"""
