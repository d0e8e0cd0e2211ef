"""Which temperatures are noted beside the touches: `sensors.yaml` of a cell → what is asked for each column T_<name>."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

from ..files.checked import Node, load
from .secrets import named_only, secret

FILE = "sensors.yaml"
NAME = re.compile(r"[A-Za-z0-9_]{1,40}")
SCHEMES = {"mtconnect": ("http", "https"), "mqtt": ("mqtt", "mqtts")}


@dataclass(frozen=True)
class Sensor:
    """One temperature: by MTConnect the data item of a device, by MQTT a topic and, of a JSON object there, a key."""

    name: str
    way: str  # mtconnect, mqtt
    url: str
    item: str = ""  # mtconnect: dataItemId or name
    key: str = ""  # mqtt
    password: str = ""  # mqtt


@dataclass(frozen=True)
class Sensors:
    """The sensors of a cell; a value counts for `old` s after it came."""

    sensors: tuple[Sensor, ...] = ()
    every: float = 5.0  # s between two questions (mtconnect)
    old: float = 60.0  # s


def read_sensors(folder: Path) -> Sensors:
    """cell → its sensors, none where it has no sensors.yaml. Raises InputError naming file, line and key of what is wrong."""
    if not (folder / FILE).exists():
        return Sensors()
    keys = load(folder / FILE).fields(("sensors",), ("every", "old"))
    every = keys["every"].number(0.5, 3600.0) if "every" in keys else Sensors.every
    old = keys["old"].number(every, 86400.0) if "old" in keys else max(Sensors.old, 3 * every)
    return Sensors(tuple(_sensor(name, node) for name, node in keys["sensors"].items()), every, old)


def _sensor(name: str, node: Node) -> Sensor:
    if not NAME.fullmatch(name):
        raise node.wrong("names of letters, digits and _", repr(name))
    way = "mqtt" if "mqtt" in dict(node.items()) else "mtconnect"
    fields = node.fields(("mqtt",), ("key", "password")) if way == "mqtt" else node.fields(("mtconnect", "item"))
    url = fields[way].text()
    named_only(url)
    try:
        parts = urlsplit(url)
        known = parts.scheme in SCHEMES[way] and bool(parts.hostname) and parts.port != 0
    except ValueError:  # brackets that hold no address, a port that is none
        known = False
    if not known or (way == "mqtt" and not parts.path.strip("/")):
        example = "mqtt://192.168.1.40/shop/room" if way == "mqtt" else "http://192.168.1.30:5000/current"
        raise fields[way].wrong(f"e.g. {example}")
    said = {key: fields[key].text() for key in ("item", "key") if key in fields}
    return Sensor(name, way, url, **said, password=secret("password", fields["password"].text()) if "password" in fields else "")
