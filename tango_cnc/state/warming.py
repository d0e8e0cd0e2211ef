"""A machine that moves on while it is measured: whether that explains tonight's touches as well as a cause of the whole night.

At the first touch it is where last night left it. From then on tip and table move apart, evenly or slower and slower, as they do
in a machine that warms up. Compared by the generalised likelihood ratio, as the causes of naming.py are.
"""

from __future__ import annotations

import numpy as np
from scipy import linalg

from ..records import Array
from .filter import State, Tonight, sigma_of
from .frame import Seen
from .naming import Named

BENDS = (0.0, 1.0, 3.0)  # times the run: how much slower it moves in the end; 0: evenly
MOSTLY = 0.7  # share of what has changed, above chance, that it explains, or it is no story


def warmed(state: State, what: Seen, time: Array, normal: Array, tonight: Tonight, named: Named | None) -> float:
    """predicted state, what n touches say, (n,) s of the touches, (n, 3) their normals in the frame of the machine, judgement of
    the night, its best story → by how much of twice the logarithm of the likelihood a machine that moves on through the run
    explains them better than that story, prices paid: negative where it does worse, -inf where it explains little.
    """
    touched = what.touch > 0
    used = ~np.isin(what.touch, tonight.outliers)
    count = int(np.sum(touched & used))
    if count < 2 or not np.ptp(time) > 0:
        return -np.inf
    through, pattern = np.zeros((len(used), 1)), np.zeros((len(used), 3))  # a certificate is no touch: nothing of it moves
    through[touched, 0], pattern[touched] = (time - time.min()) / np.ptp(time), normal
    rows, through = what.rows[used], through[used]
    sigma = sigma_of(state)
    own = rows @ state.root / sigma
    innovation = (what.value[used] - rows @ state.mean) / sigma
    weight = linalg.inv(np.eye(len(own)) + own @ own.T) / max(tonight.scale, 1.0)
    pull = weight @ innovation
    gain = 0.0
    for bend in BENDS:
        acts = pattern[used] / sigma * (through if bend == 0 else -np.expm1(-bend * through))
        along = acts.T @ pull
        gain = max(gain, float(along @ linalg.pinvh(acts.T @ weight @ acts) @ along))
    if gain < MOSTLY * (float(innovation @ pull) - len(own)):
        return -np.inf
    price = float(np.log(count))
    every = () if named is None else named.all
    return gain - 4 * price - sum(one.explained - price * len(one.size) for one in every)
