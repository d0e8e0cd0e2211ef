"""temperature.yaml → what scales mean at 20 °C (ISO 1) and as found, with the uncertainty of the expansions (ISO 230-2:2014, A.2).

The bar is as long as its certificate says at 20 °C only. At its own temperature it is longer by α ΔT, and so is every way that
was measured by it: scale as found = scale read + α_bar ΔT_bar. Taken back to 20 °C, the scales of the machine shrink by their
own expansion: scale at 20 °C = scale as found − α_machine ΔT_machine.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ..files.checked import Node, load
from ..records import InputError

REFERENCE = 20.0  # °C, ISO 1
COLD, HOT = -20.0, 50.0  # °C, of anything in a workshop; 20 °C in °F is 68
KELVIN = 273.15  # K, of 0 °C
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
    """

    bar: Known
    machine: Known
    bar_expansion: Known
    machine_expansion: Known
    table: Known | None = None
    table_expansion: Known | None = None
    cmm: Known | None = None
    assumed: bool = False  # nobody has stated it

    @property
    def text(self) -> str:
        """→ for people: every temperature and expansion with its standard uncertainty."""
        pairs = [("bar", self.bar, self.bar_expansion), ("machine", self.machine, self.machine_expansion)]
        if self.table is not None and self.table_expansion is not None:
            pairs.append(("table", self.table, self.table_expansion))
        told = [f"{n} {t.value:g} ± {t.std:g} °C, {1e6 * e.value:g} ± {1e6 * e.std:g} µm/m/K" for n, t, e in pairs]
        if self.cmm is not None:
            told.append(f"CMM {self.cmm.value:g} ± {self.cmm.std:g} °C")
        return "; ".join(told) + " (standard uncertainties)"


# 1/K. Steel and cast iron have 10 to 12, glass scales 8: where nothing is known, they are as likely as what lies between.
USUAL = Known(11.5e-6, 2e-6)

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

    Raises InputError for keys that do not exist and for values that no workshop has.
    """
    more = ("table", "table_expansion", "cmm")
    fields = load(file).fields(["bar", "machine"], ["bar_expansion", "machine_expansion", *more])
    given = [key for key in more if key in fields]
    if given and len(given) < len(more):
        lacking = ", ".join(key for key in more if key not in fields)
        raise fields[given[0]].wrong(f"table, table_expansion and cmm together: a CMM is compared with all three, add {lacking}")
    return Thermal(
        _temperature(fields["bar"]),
        _temperature(fields["machine"]),
        _expansion(fields["bar_expansion"]) if "bar_expansion" in fields else USUAL,
        _expansion(fields["machine_expansion"]) if "machine_expansion" in fields else USUAL,
        *((_temperature(fields["table"]), _expansion(fields["table_expansion"]), _temperature(fields["cmm"])) if given else ()),
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
        raise InputError("temperature.yaml: found no table, table_expansion and cmm; allowed: all three, to compare with a CMM")
    apart, e = thermal.table.value - thermal.cmm.value, thermal.table_expansion
    own, expands = (thermal.bar, thermal.bar_expansion) if by_bar else (thermal.machine, thermal.machine_expansion)
    value = e.value * apart - expands.value * (own.value - REFERENCE)
    variance = (e.value**2 + e.std**2) * (thermal.table.std**2 + thermal.cmm.std**2) + (e.std * apart) ** 2
    variance += (expands.value**2 + expands.std**2) * own.std**2 + (expands.std * (own.value - REFERENCE)) ** 2
    return Known(float(value), float(variance**0.5))
