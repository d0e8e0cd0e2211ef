"""nightly.yaml → what a night of this cell is to do, within which limits, and whom to tell."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..records import InputError
from .checked import Node, load
from .gathered import gathered

NAME = "nightly.yaml"
WEEK = 7.0  # days
RANGES = {  # key: lowest (0: above it) and highest number
    **dict.fromkeys(
        ("check_minutes", "full_every_days", "volume_std_um", "late_hours", "every_days", "stale_days"), (0.0, 100_000.0)
    ),
    "false_alarm_nights": (10.0, 100_000.0),
}
FROM_ZERO = {"free_mb": 1e9, "warm_up_minutes": 600.0, "control_starts_within": 3600.0}  # key: highest number
SCHEMES = ("mailto", "http", "https", "mqtt", "mqtts", "apprise", "file")


@dataclass(frozen=True)
class Nightly:
    """Settings of the nights of one cell; every one has a default."""

    history: str = "history.db"  # file in the cell, or a URL
    owner: str = ""  # of the machine: who is asked about an alarm
    deputy: str = ""  # who is asked where the owner does not answer
    check_minutes: float = 5.5  # of machine time for a short night
    full_every_days: float = 30.0
    volume_std_um: float = 5.0  # standard deviation over the volume beyond which the full strategy runs
    false_alarm_nights: float = 730.0  # nights between two false alarms, on average
    limits: Mapping[str, float] = field(default_factory=dict)  # volume in µm; parameters in µm, µrad, µm/m
    limits_for: str = ""  # what the limits are for, and who has stated them
    sensor: str | None = None  # temperature column that counts; None: the mean of all
    temperature: tuple[float, float] | None = None  # °C within which a night may begin
    warm_up_minutes: float = (
        0.0  # a colder machine runs the program of the night for so long at most, unjudged, before it is measured
    )
    control_starts_within: float = 0.0  # s in which a control that starts the program by itself does; 0: a person starts it
    free_mb: float = 200.0
    late_hours: float = 36.0
    every_days: float = 1.0
    stale_days: float | None = None  # after which a result is no answer of today; None: see `answers_for`
    commissioned: bool = False  # whether a night needs commissioning.yaml
    diagnose: bool = True  # after full nights, and after alarms
    probe: bool = False  # whether a control that cannot say how its probe is may be used
    notify: tuple[str, ...] = ()
    templates: Path | None = None  # folder with texts.toml and templates of the shop (docs/report.md)

    @property
    def answers_for(self) -> float:
        """→ days for which a result answers whether parts may be made: those that are stated, else a week, or two rounds of
        `every_days`, or `late_hours`, whichever is longest.
        """
        return self.stale_days if self.stale_days is not None else max(WEEK, 2 * self.every_days, self.late_hours / 24)


def read_nightly(folder: Path) -> Nightly:
    """folder of a cell → settings of its nights; the defaults where there is no nightly.yaml. Raises InputError."""
    file = folder / NAME
    if not file.exists():
        return Nightly()
    with gathered() as read:
        fields = read.fields(load(file), ["nightly"], [*Nightly.__dataclass_fields__])
        values = read.each(fields.items(), lambda item: _value(folder, *item))
        if "warm_up_minutes" in fields and "temperature" not in fields:
            raise fields["warm_up_minutes"].wrong("a temperature as well, [low, high] in °C: it says when the machine is warm")
    given = dict(zip(fields, values, strict=True))
    del given["nightly"]
    return Nightly(**given)


def _value(folder: Path, key: str, node: Node) -> Any:
    """folder of the cell, key, its value → the setting. Raises InputError."""
    if key == "nightly":
        if node.integer() != 1:
            raise node.wrong("1, the version of the format that this program reads")
        return 1
    if key in ("history", "owner", "deputy", "limits_for", "sensor"):
        if key == "history" and "://" not in node.text():
            node.named(folder)
        return node.text()
    if key in RANGES:
        low, high = RANGES[key]
        return node.number(low, high) if low else node.number(above=0, high=high)
    if key in FROM_ZERO:
        return node.number(0, FROM_ZERO[key])
    if key in ("commissioned", "diagnose", "probe"):
        return node.boolean()
    if key == "limits":
        return {name: child.number(above=0, high=1e6) for name, child in node.items()}
    if key == "temperature":
        low, high = (item.number(-50, 80) for item in node.list(2))
        if low >= high:
            raise node.wrong("[low, high] in °C with low below high", f"[{low:g}, {high:g}]")
        return low, high
    if key == "templates":
        if not (folder / node.text()).is_dir():
            raise node.wrong("a folder, from the cell, with texts.toml or templates of the shop")
        return folder / node.text()
    for item in node.list():  # notify
        if item.text().split(":")[0] not in SCHEMES:
            raise item.wrong(f"a URL that begins with {', '.join(SCHEMES)}")
    return tuple(item.text() for item in node.list())


def history_of(folder: Path, settings: Nightly, given: str | None = None) -> str | Path:
    """folder, settings, --history → file or URL of the history. Raises InputError for an empty one."""
    where = given if given is not None else settings.history
    if not where:
        raise InputError("history: found ''; allowed: a file, or postgresql://user:${NAME}@host/database")
    if "://" in where:
        return where
    return Path(where) if given is not None else folder / where
