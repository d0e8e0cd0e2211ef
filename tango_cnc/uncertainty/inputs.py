"""What disturbs the readings, as covariances: one `Part` a line of the budget.

The input quantities are the n gaps of the touches and the m known distances (calibrated facets, scale bar). A part says
how they move together: deviation = factor · ξ with independent ξ of unit variance. White noise is a diagonal factor, a
drift that wanders a dense one, probe lobing two columns. Kinds of parts are the files of `sources/` (docs/uncertainty.md).
"""

from __future__ import annotations

import importlib
import inspect
import math
import pkgutil
import typing
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from types import ModuleType
from typing import Any, Literal

import numpy as np

from .. import kinematics
from ..files.checked import Node, load, suggestion
from ..model import Model, errors, gap, known
from ..records import Array
from ..touches import Touches

SIZES = ("std", "amplitude", "range")  # settings that say how large a source is
LARGEST = 0.5  # mm or degrees: beyond it µm were written for mm, or arc seconds for degrees
Law = Literal["normal", "rectangular", "phase", "student"]


@dataclass(frozen=True)
class Part:
    """One line of the budget; `law` is the distribution of ξ: a phase takes columns in pairs (√2 cos φ, √2 sin φ)."""

    label: str
    factor: Array  # (n + m, k) mm
    law: Law = "normal"
    dof: float = math.inf  # degrees of freedom of a student
    repeats: bool = True  # a repetition of the same program draws it anew, and therefore shows it
    shared: bool = False  # the same ξ act on every other set of touches (a probe's lobing, the scale bar)

    @cached_property
    def covariance(self) -> Array:
        """→ (n + m, n + m) mm²."""
        result: Array = self.factor @ self.factor.T
        return result


@dataclass(frozen=True)
class Scene:
    """The touches as a source of uncertainty sees them, at the converged estimate."""

    model: Model
    values: Array  # (p,)

    @property
    def touches(self) -> Touches:
        """→ the n touches."""
        return self.model.touches

    @cached_property
    def _sight(self) -> kinematics.Sensitivity:
        touches = self.touches
        machine, offsets, shifts = self.model.split(self.values)
        run = kinematics.trace(touches.chain, touches.position, errors(self.model, machine))
        return kinematics.sensitivity(touches.chain, run, gap(touches, run.tip, offsets, shifts)[1])

    @property
    def normal(self) -> Array:
        """→ (n, 3) outward normals in the machine frame."""
        return self._sight.machine_normal

    @property
    def normal_spindle(self) -> Array:
        """→ (n, 3) outward normals in the frame that turns with the spindle."""
        return self._sight.spindle_normal

    def lever(self, axis: str) -> Array:
        """letter → (n,) mm of gap per mm or rad that this axis goes further than its scale says."""
        return self._sight.slots[kinematics.Slot(axis, "motion")]

    @cached_property
    def stated(self) -> Array:
        """→ (m,) mm, stated uncertainties of the calibrated facets and of the scale bar, in this order."""
        return known(self.model, self.values)[2]

    def on_touches(self, factor: Array) -> Array:
        """(n, k) → (n + m, k): nothing happens to the known distances."""
        return np.vstack([factor, np.zeros((len(self.stated), factor.shape[1]))])

    def along(self, covariance: Array) -> Array:
        """(n, n) mm², of a displacement in each of x y z of the machine frame → (n + m, k) factor of what the touches see."""
        seen = covariance * (self.normal @ self.normal.T)
        values, vectors = np.linalg.eigh(seen)
        keep = values > 1e-12 * values[-1]
        return self.on_touches(vectors[:, keep] * np.sqrt(values[keep]))


@dataclass(frozen=True)
class BudgetLine:
    """One checked line of a budget: a source and its settings."""

    source: str
    settings: dict[str, Any]


def sources() -> list[str]:
    """→ every source by name: the files of `sources/`."""
    from . import sources as folder

    return sorted(m.name for m in pkgutil.iter_modules(folder.__path__) if not m.name.startswith("_"))


def _module(name: str) -> ModuleType:
    return importlib.import_module(f"{__package__}.sources.{name}")


def read_budget(file: Path) -> tuple[BudgetLine, ...]:
    """uncertainty.yaml → its lines. Raises InputError for sources, keys and values that do not exist (docs/uncertainty.md)."""
    return tuple(_line(node) for node in load(file).fields(["contributions"])["contributions"].list())


def _line(node: Node) -> BudgetLine:
    given = dict(node.items())
    if "source" not in given:
        raise node.wrong("a mapping with the key 'source'", "no source")
    name = given.pop("source").text(sources())
    function = _module(name).factor
    hints = typing.get_type_hints(function)
    keys = {k: p for k, p in inspect.signature(function).parameters.items() if p.kind is inspect.Parameter.KEYWORD_ONLY}
    settings = {}
    for key, child in given.items():
        if key not in keys:
            raise child.wrong(f"{', '.join(keys)} for {name}.{suggestion(key, list(keys))}", f"the unknown key {key!r}")
        settings[key] = _size(child) if key in SIZES else _setting(child, hints[key])
    for key, parameter in keys.items():
        if key not in given and parameter.default is inspect.Parameter.empty:
            raise node.wrong(f"a value for {key!r}, which {name} requires", f"no {key!r}")
    return BudgetLine(name, settings)


def _size(node: Node) -> float:
    value = node.number()
    if not 0 <= value <= LARGEST:
        raise node.wrong(f"0 to {LARGEST:g} (mm; degrees for angles). 0.6 µm is written 0.0006, 5 arc seconds 0.0014", f"{value:g}")
    return value


def _setting(node: Node, kind: Any) -> Any:
    optional = [k for k in typing.get_args(kind) if k is not type(None)]
    kind = optional[0] if type(None) in typing.get_args(kind) else kind
    if typing.get_origin(kind) is Literal:
        return node.text(typing.get_args(kind))
    if kind is float:
        return node.number()
    if kind is int:
        return node.integer(1)
    if kind is str:
        return node.text()
    return tuple(item.identifier() for item in node.list())


def stated(scene: Scene) -> tuple[BudgetLine, ...]:
    """scene → the budget when none is given: repeatability as in machine.yaml and whatever artefact.yaml says is known."""
    return _complete(scene, (BudgetLine("repeatability", {}),))


def _complete(scene: Scene, lines: tuple[BudgetLine, ...]) -> tuple[BudgetLine, ...]:
    """The uncertainty of what the estimate takes for known is never left out, whether the file names it or not."""
    given = {line.source for line in lines}
    more = []
    if scene.model.bar is not None and "scale_bar" not in given:
        more.append(BudgetLine("scale_bar", {}))
    if scene.model.calibrated and "calibrated_facets" not in given:
        more.append(BudgetLine("calibrated_facets", {}))
    return (*lines, *more)


def parts(scene: Scene, lines: tuple[BudgetLine, ...]) -> tuple[Part, ...]:
    """scene, lines of a budget → their parts, labels made unique. Raises InputError for settings that do not fit the machine."""
    found: list[Part] = []
    for line in _complete(scene, lines):
        module = _module(line.source)
        factor, law = module.factor(scene, **line.settings)
        same = sum(part.label.split(" ")[0] == line.source for part in found)
        label = line.source if not same else f"{line.source} {same + 1}"
        found.append(Part(label, factor, law, repeats=module.REPEATS, shared=module.SHARED))
    return tuple(found)


def gaussian(of: tuple[Part, ...]) -> tuple[Array, tuple[Part, ...]]:
    """parts → (n + m, r) factor of everything normal together, and the parts that are not."""
    normal = [part for part in of if part.law == "normal"]
    rest = tuple(replace(part) for part in of if part.law != "normal")
    size = len(of[0].factor)
    total = sum((part.covariance for part in normal), np.zeros((size, size)))
    values, vectors = np.linalg.eigh(total)
    keep = values > 1e-13 * max(float(values[-1]), 0.0)
    return vectors[:, keep] * np.sqrt(values[keep]), rest


def draw(rng: np.random.Generator, count: int, factor: Array, rest: tuple[Part, ...]) -> Array:
    """generator, number of trials, what `gaussian` gave → (count, n + m) mm deviations of the inputs."""
    result: Array = rng.standard_normal((count, factor.shape[1])) @ factor.T
    for part in rest:
        result += _unit(rng, part, count) @ part.factor.T
    return result


def _unit(rng: np.random.Generator, part: Part, count: int) -> Array:
    columns = part.factor.shape[1]
    if part.law == "rectangular":
        return rng.uniform(-math.sqrt(3), math.sqrt(3), (count, columns))
    if part.law == "phase":
        phase = rng.uniform(0, 2 * math.pi, (count, columns // 2))
        return math.sqrt(2) * np.stack([np.cos(phase), np.sin(phase)], axis=-1).reshape(count, columns)
    scale = np.sqrt(part.dof / rng.chisquare(part.dof, (count, 1)))
    return rng.standard_normal((count, columns)) * scale
