"""temperature.yaml → what scales mean at 20 °C (ISO 1) and as found, with the uncertainty of the expansions (ISO 230-2:2014, A.2).

The bar is as long as its certificate says at 20 °C only. At its own temperature it is longer by α ΔT, and so is every way that
was measured by it: scale as found = scale read + α_bar ΔT_bar. Taken back to 20 °C, the scales of the machine shrink by their
own expansion: scale at 20 °C = scale as found − α_machine ΔT_machine.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..files.checked import Node, load
from ..records import InputError

REFERENCE = 20.0  # °C, ISO 1
COLD, HOT = -20.0, 50.0  # °C, of anything in a workshop; 20 °C in °F is 68
KELVIN = 273.15  # K, of 0 °C
STATED = ("bar", "machine", "table", "air", "cmm")  # of which a temperature may be stated
SURE = 0.005  # K, below which nobody knows the temperature of a thing in a workshop
ALIKE = 0.02  # µm/m/K, below which nobody knows an expansion (ISO/TR 230-9)
SMALLEST, LARGEST = 0.01, 40.0  # µm/m/K, of anything but a glass ceramic, which is written 0


@dataclass(frozen=True)
class Known:
    """A value and its standard uncertainty."""

    value: float
    std: float


NO_CHANGE = Known(0.0, 0.0)


@dataclass(frozen=True)
class Thermal:
    """Temperatures (°C) and expansions (1/K) of what carries the scale, bar or calibrated facets, and of the machine.

    `table`, `table_expansion` and `cmm`: of the table on the machine, and the temperature at which the values of a CMM hold.
    `air`: beside the machine; what is not stated is taken to be as warm as it, ± `INDOORS`.
    """

    bar: Known
    machine: Known
    bar_expansion: Known
    machine_expansion: Known
    table: Known | None = None
    table_expansion: Known | None = None
    cmm: Known | None = None
    assumed: bool = False  # nobody has stated it
    air: Known | None = None
    by_air: tuple[str, ...] = ()  # what was taken to be as warm as the air

    @property
    def text(self) -> str:
        """→ for people: every temperature and expansion with its standard uncertainty."""
        pairs = [("bar", self.bar, self.bar_expansion), ("machine", self.machine, self.machine_expansion)]
        if self.table is not None and self.table_expansion is not None:
            pairs.append(("table", self.table, self.table_expansion))
        told = [f"{n} {t.value:g} ± {t.std:.2g} °C, {1e6 * e.value:g} ± {1e6 * e.std:g} µm/m/K" for n, t, e in pairs]
        if self.air is not None:
            who = f" ({' and '.join(self.by_air)} taken to be as warm)" if self.by_air else ""
            told.append(f"air {self.air.value:g} ± {self.air.std:.2g} °C{who}")
        if self.cmm is not None:
            told.append(f"CMM {self.cmm.value:g} ± {self.cmm.std:.2g} °C")
        return "; ".join(told) + " (standard uncertainties)"


# 1/K. Steel and cast iron have 10 to 12, glass scales 8: where nothing is known, they are as likely as what lies between.
USUAL = Known(11.5e-6, 2e-6)

# 1/K. A table of steel or cast iron has 11.5, one of aluminium 23: where nobody says which, it is as likely the one as the other.
TABLES = Known(17e-6, 6e-6)

INDOORS = 1.5  # K, standard uncertainty of how much warmer than the air a bar, a table or a machine is that stands in it

# °C, of bar and machine each, in a workshop where nobody has looked: 2.8 K between them, in 19 of 20 shops less than 5.7 K
SHOP = Known(REFERENCE, 2.0)
ASSUMED = Thermal(SHOP, SHOP, USUAL, USUAL, assumed=True)


def state_of(thermal: Thermal | None, at_reference: bool) -> str:
    """temperatures, whether the person wants figures at 20 °C → the words for what the scales refer to."""
    if thermal is None:
        return "not stated"
    return ("20 °C" if at_reference else "as found") + (", assumed" if thermal.assumed else "")


def read_thermal(file: Path) -> Thermal:
    """temperature.yaml (`bar: [20.4, 0.1]` °C; `bar_expansion: [11.5, 0.6]` µm/m/K; value, standard uncertainty) → thermal state.

    `bar` and `machine` are needed, or `air`: what is not stated is taken to be as warm as it, less surely. Raises InputError for
    keys that do not exist and for values that no workshop has.
    """
    node = load(file)
    fields = node.fields([], [*STATED, *(f"{name}_expansion" for name in ("bar", "machine", "table"))])
    air = _temperature(fields["air"]) if "air" in fields else None
    around = None if air is None else Known(air.value, float(np.hypot(air.std, INDOORS)))
    missing = [name for name in ("bar", "machine") if name not in fields]
    if missing and around is None:
        raise node.wrong(f"bar and machine, or air, as [°C, standard uncertainty]; add {' and '.join(missing)}")
    warm = {name: _temperature(fields[name]) if name in fields else around for name in ("bar", "machine", "table")}
    bar, machine, table = warm["bar"], warm["machine"], warm["table"]
    assert bar is not None and machine is not None
    grow = {name: _expansion(fields[f"{name}_expansion"]) for name in warm if f"{name}_expansion" in fields}
    cmm = _temperature(fields["cmm"]) if "cmm" in fields else None
    stated = "table" in fields or "table_expansion" in fields or cmm is not None
    if stated and table is None:
        raise node.wrong("table or air beside table_expansion and cmm: how warm the table is on the machine, in °C")
    by_air = tuple(name for name in ("bar", "machine", *(["table"] if stated else [])) if name not in fields)
    return Thermal(
        bar,
        machine,
        grow.get("bar", USUAL),
        grow.get("machine", USUAL),
        table if stated else None,
        grow.get("table", TABLES) if stated else None,
        cmm,
        air=air,
        by_air=by_air,
    )


def _temperature(node: Node) -> Known:
    value, std = node.list(2)
    if std.number() < SURE:
        raise std.wrong(f"a standard uncertainty of {SURE:g} K or more: nothing in a workshop is known better than that")
    if (found := value.number()) > HOT:
        meant = f"{found:g} °F are {(found - 32) / 1.8:.1f}" if found < KELVIN else f"{found:g} K are {found - KELVIN:.1f}"
        raise value.wrong(f"°C, {COLD:g} to {HOT:g}: {meant} °C")
    return Known(value.number(COLD, HOT), std.number(SURE, HOT - COLD))


def _expansion(node: Node) -> Known:
    """[value, standard uncertainty] in µm/m/K → 1/K. 0 stands for a glass ceramic; what is smaller than any other solid is 1/K."""
    value, std = node.list(2)
    found = value.number(0.0, LARGEST)
    if 0 < found < SMALLEST:
        raise value.wrong(f"µm/m/K, 0 or {SMALLEST:g} to {LARGEST:g}: {found:g}/K is written {1e6 * found:g}")
    if std.number() < ALIKE:
        raise std.wrong(
            f"a standard uncertainty of {ALIKE:g} µm/m/K or more: no expansion is known better than that (0.5 is usual of a "
            "certificate, 2 of a guess)"
        )
    return Known(1e-6 * found, 1e-6 * std.number(ALIKE, LARGEST))


def scale(thermal: Thermal, at_reference: bool) -> Known:
    """thermal state, whether at 20 °C or as found → what to add to a scale that was read, mm/mm, and its standard uncertainty."""
    parts = [(thermal.bar, thermal.bar_expansion, 1.0)]
    if at_reference:
        parts.append((thermal.machine, thermal.machine_expansion, -1.0))
    value = sum(sign * expansion.value * (t.value - REFERENCE) for t, expansion, sign in parts)
    # the product of two uncertain numbers keeps its last term: at 20 °C the expansion alone would contribute nothing
    variance = sum((e.value * t.std) ** 2 + (e.std * (t.value - REFERENCE)) ** 2 + (e.std * t.std) ** 2 for t, e, _ in parts)
    return Known(float(value), float(variance**0.5))


def grows(thermal: Thermal) -> Known:
    """thermal state → growth of the bar since 20 °C, mm/mm: by so much is a millimeter longer in which scales are read."""
    return scale(thermal, at_reference=False)


def grown(thermal: Thermal, by_bar: bool) -> Known:
    """thermal state, whether a bar carries the scale (else: the machine's scales do) → growth of a CMM's lengths, mm/mm, and std.

    By it they are as the machine reads them. Raises InputError where the temperatures of table and CMM are not stated.
    """
    if thermal.table is None or thermal.table_expansion is None or thermal.cmm is None:
        raise InputError("temperature.yaml: found no table and cmm; allowed: both, to compare with a CMM")
    apart, e = thermal.table.value - thermal.cmm.value, thermal.table_expansion
    own, expands = (thermal.bar, thermal.bar_expansion) if by_bar else (thermal.machine, thermal.machine_expansion)
    value = e.value * apart - expands.value * (own.value - REFERENCE)
    variance = (e.value**2 + e.std**2) * (thermal.table.std**2 + thermal.cmm.std**2) + (e.std * apart) ** 2
    variance += (expands.value**2 + expands.std**2) * own.std**2 + (expands.std * (own.value - REFERENCE)) ** 2
    return Known(float(value), float(variance**0.5))
