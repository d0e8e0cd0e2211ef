"""`diagnose` for arrays that are already in memory: the same as `--table`, without a file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..records import Array, InputError
from ._gain import groups_of
from .table import KINDS, MOST_ROWS, Table, told

LEAST_ROWS = 7


def diagnose_arrays(
    response: ArrayLike,
    covariates: Mapping[str, tuple[str, ArrayLike | Sequence[str]]],
    model: ArrayLike | None = None,
    groups: Sequence[object] | None = None,
    seed: int = 0,
) -> dict[str, Any]:
    """(n,) or (n, q) responses, name: (kind, (n,) values) → plain data of the format tango-diagnosis/1, in the response's unit.

    Rows in the order of measurement. Kinds as of `--covariate`: time, order, position, angle (degrees) or category (any names).
    `model`: (n, p) columns that the present linear model contains besides its intercept; `groups`: (n,) rows with the same
    value are held out together. Raises InputError for lengths, kinds and values that do not fit.
    """
    y = np.asarray(response, dtype=float)
    y = y[:, None] if y.ndim == 1 else y
    if y.ndim != 2 or not LEAST_ROWS <= len(y) <= MOST_ROWS or not np.isfinite(y).all():
        raise InputError(f"response: found {np.shape(response)}; allowed: {LEAST_ROWS} to {MOST_ROWS} rows of finite numbers")
    n = len(y)
    known: dict[str, tuple[str, Array]] = {}
    labels: dict[str, tuple[str, ...]] = {}
    for name, (kind, values) in covariates.items():
        if kind not in KINDS:
            raise InputError(f"covariates: {name}: found {kind!r}; allowed: {', '.join(KINDS)}")
        if kind == "category":
            texts = [str(v) for v in np.asarray(values).ravel()]
            labels[name] = tuple(dict.fromkeys(texts))
            column = np.array([labels[name].index(t) for t in texts], dtype=float)
        else:
            column = _numbers(name, values)
        if column.shape != (n,):
            raise InputError(f"covariates: {name}: found {column.shape}; allowed: ({n},), one value a row")
        known[name] = kind, np.radians(column) if kind == "angle" else column
    if not known:
        known["order"] = "order", np.arange(1.0, n + 1)
    columns = np.empty((n, 0)) if model is None else _numbers("model", model).reshape(len(np.asarray(model)), -1)
    if len(columns) != n or (groups is not None and len(groups) != n):
        raise InputError(f"model, groups: found {len(columns)} and {n if groups is None else len(groups)} rows; allowed: {n}")
    held = None if groups is None else groups_of(list(groups)).astype(float)
    names = tuple(f"response {i + 1}" for i in range(y.shape[1]))
    return told(Table(y, names, np.column_stack([np.ones(n), columns]), known, labels, held), "groups", seed)


def _numbers(name: str, values: object) -> Array:
    try:
        found = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{name}: found {values!r:.60}; allowed: numbers") from None
    if not np.isfinite(found).all():
        raise InputError(f"{name}: found a value that is not finite; allowed: finite numbers")
    return found
