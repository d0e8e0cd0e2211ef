"""Parameters over the nights, drawn; control charts on request."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

import numpy as np

from ..records import Array, InputError
from ..texts import say
from .compensated import compensations
from .records import Trend
from .store import History

GIVEN = ("written", "rolled back")  # events after which the control is another one
SCALE = {"mm": (1e3, "µm"), "rad": (1e6, "µrad"), "mm/mm": (1e6, "µm/m")}


def standardised(history: History, trend: Trend) -> Array:
    """history, n nights of a parameter → (n,) change of each night in standard deviations, as it was expected of a quiet machine.

    What a short and a full night change differs by design: by one scatter for both, a chart would alarm five times as often. Nights
    from before that was kept are divided by what is usual among them.
    """
    records = history.records_of(trend.entries)
    told = [records[entry]["parameters"][trend.name] for entry in trend.entries]
    step = np.diff(trend.value, prepend=trend.value[:1])
    usual = 1.4826 * float(np.median(np.abs(step[1:]))) if len(step) > 1 else 1.0
    pairs = [(p.get("change"), p.get("change_std")) for p in told]
    return np.array([(c or 0.0) / s if s else 0.0 if s == 0 else d / (usual or 1.0) for (c, s), d in zip(pairs, step, strict=True)])


def picture(history: History, machine: str, trends: Sequence[Trend], file: Path, chart: str | None = None) -> None:
    """history, machine, trends of its parameters, file, kind of chart → written. Raises InputError without matplotlib."""
    try:
        import matplotlib

        matplotlib.use("Agg")
        from matplotlib import pyplot as plt
    except ModuleNotFoundError:
        raise InputError("plot: needs matplotlib; pip install 'tango-cnc[report]'") from None
    from ..state import charts

    alarms = [datetime.fromisoformat(n.start_utc) for n in history.nights(machine) if n.alarms]
    figure, axes = plt.subplots(len(trends), 1, sharex=True, figsize=(9, 1.2 + 1.7 * len(trends)), squeeze=False)
    control = [(datetime.fromisoformat(e.utc), e) for e in compensations(history, machine) if e.event in GIVEN]
    for axis, trend in zip(axes[:, 0], trends, strict=True):
        name = trend.name
        factor, unit = SCALE.get(trend.unit, (1.0, trend.unit))
        when = [datetime.fromisoformat(s) for s in trend.start_utc]
        value, std = trend.value * factor, trend.std * factor
        if chart is None:
            axis.fill_between(when, value - 1.96 * std, value + 1.96 * std, alpha=0.25, lw=0)
            axis.plot(when, value, marker=".", lw=1)
            axis.set_ylabel(f"{name}\n{unit}")
        else:
            drawn = charts.KINDS[chart](standardised(history, trend))
            axis.plot(when, drawn.value, marker=".", lw=1)
            axis.plot(when, drawn.high, "r--", when, drawn.low, "r--", lw=0.8)
            axis.set_ylabel(f"{name}\n{chart}")
            axis.set_title(say("picture.one_false_alarm", nights=f"{drawn.nights_to_false_alarm:.0f}"), fontsize=8, loc="right")
        for alarm in alarms:
            axis.axvline(alarm, color="tab:red", lw=1, alpha=0.6)
        begin, end = (when[0], when[-1]) if when else (None, None)
        for at, event in [(a, e) for a, e in control if begin is not None and end is not None and begin <= a <= end]:
            axis.axvline(at, color="tab:gray", lw=1, ls=":")
            said = say("picture.compensation", number=event.number, event=event.event)
            axis.annotate(said, (at, 1), xycoords=("data", "axes fraction"), fontsize=6, rotation=90, va="top", ha="right")
    title = say("picture.nights", machine=machine) if chart is None else machine
    if history.simulated(machine):
        title = f"{say('audit.simulated')}\n{title}"
    axes[0, 0].set_title(title, fontsize=10, loc="left")
    figure.autofmt_xdate()
    figure.tight_layout()
    try:
        figure.savefig(file, dpi=130)
    except ValueError as error:
        raise InputError(f"{file}: {error}; allowed: .png, .svg, .pdf") from None
    finally:
        plt.close(figure)
