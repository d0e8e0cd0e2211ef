"""temperature.yaml → what scales mean at 20 °C (ISO 1) and as found, with the uncertainty of the expansions (ISO 230-2:2014, A.2).

The bar is as long as its certificate says at 20 °C only. At its own temperature it is longer by α ΔT, and so is every way that
was measured by it: scale as found = scale read + α_bar ΔT_bar. Taken back to 20 °C, the scales of the machine shrink by their
own expansion: scale at 20 °C = scale as found − α_machine ΔT_machine.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ..files.checked import Node, load

REFERENCE = 20.0  # °C, ISO 1


@dataclass(frozen=True)
class Known:
    """A value and its standard uncertainty."""

    value: float
    std: float


@dataclass(frozen=True)
class Thermal:
    """Temperatures (°C) and expansions (1/K) of what carries the scale, bar or calibrated facets, and of the machine."""

    bar: Known
    machine: Known
    bar_expansion: Known
    machine_expansion: Known


USUAL = Known(11.5e-6, 1e-6)  # 1/K, steel and most scales


def read_thermal(file: Path) -> Thermal:
    """temperature.yaml (`bar: [20.4, 0.1]` °C; `bar_expansion: [11.5, 0.6]` µm/m/K; value, standard uncertainty) → thermal state.

    Raises InputError for keys that do not exist and for values that no workshop has.
    """
    fields = load(file).fields(["bar", "machine"], ["bar_expansion", "machine_expansion"])
    return Thermal(
        _known(fields["bar"], -20.0, 80.0),
        _known(fields["machine"], -20.0, 80.0),
        _known(fields["bar_expansion"], 0.0, 40.0, 1e-6) if "bar_expansion" in fields else USUAL,
        _known(fields["machine_expansion"], 0.0, 40.0, 1e-6) if "machine_expansion" in fields else USUAL,
    )


def _known(node: Node, low: float, high: float, factor: float = 1.0) -> Known:
    value, std = node.list(2)
    return Known(factor * value.number(low, high), factor * std.number(0.0))


def scale(thermal: Thermal, at_reference: bool) -> Known:
    """thermal state, whether at 20 °C or as found → what to add to a scale that was read, mm/mm, and its standard uncertainty."""
    parts = [(thermal.bar, thermal.bar_expansion, 1.0)]
    if at_reference:
        parts.append((thermal.machine, thermal.machine_expansion, -1.0))
    value = sum(sign * expansion.value * (t.value - REFERENCE) for t, expansion, sign in parts)
    # the product of two uncertain numbers keeps its last term: at 20 °C the expansion alone would contribute nothing
    variance = sum((e.value * t.std) ** 2 + (e.std * (t.value - REFERENCE)) ** 2 + (e.std * t.std) ** 2 for t, e, _ in parts)
    return Known(float(value), float(variance**0.5))
