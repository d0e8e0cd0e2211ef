"""What disturbs a measurement beyond the constant errors of the machine: one file a cause, named after it (docs/effects.md).

A file `<cause>.py` holds one function and one example of its keys, with which the tests try it

    EXAMPLE = {"amplitude": 0.002}
    def disturb(history: History, rng: np.random.Generator, *, amplitude: float, …) -> Disturbance

* Its keyword arguments are the keys that `world.yaml` may give beside `cause`; one without a default is required. The
  annotation says what is allowed: float, int, bool, Vector, Literal[…] and the kinds of `_kinds.py`. Lengths are mm, angles
  deg, times s; sizes of errors of rotation are rad, as the coefficients of `errors` are (docs/effects.md).
* It is pure. Row i of the result depends on rows 0 … i of the history only, random numbers included: draw them row by row
  (`rng.normal(size=(n, …))` does). So a program that runs touch by touch and a simulation at one go see the same machine.
* It works before the first touch, too: with no rows the keys are tried, and what does not go together raises InputError.
* It returns what it changes, in whichever form is physical (`Disturbance`). A positive `gap` makes the ball read the surface
  early, outside of where it is: the `r` of the catalogue of causes.
* Tests compare it with the term of its name and hide it among others. A file whose keys are no settings of the term states
  `OTHERWISE = "why; the test that compares them"`; one that is not to be hidden states `UNDRAWN = "why"`.
"""

from ._apply import Effect, checked, described, disturbance, example, names, stated
from ._history import Disturbance, History, lever, unit

__all__ = ["Disturbance", "Effect", "History", "checked", "described", "disturbance", "example", "lever", "names", "stated", "unit"]
