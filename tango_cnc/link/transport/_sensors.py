"""Temperatures from MTConnect agents and MQTT brokers, beside a run: whatever fails here leaves a value out and ends nothing."""

from __future__ import annotations

import contextlib
import json
import math
import re
import threading
import time
import urllib.request
from collections.abc import Mapping
from typing import Any
from urllib.parse import unquote, urlsplit
from xml.parsers import expat

from ...records import InputError
from ..sensors import Sensor, Sensors

LARGEST = 4 << 20  # bytes of an answer or a message
ANSWER = 5.0  # s that an agent may take
COLDEST, HOTTEST = -100.0, 500.0  # °C; anything else is no temperature of a machine
NUMBER = re.compile(r"[+-]?([0-9]{1,9}(\.[0-9]{0,20})?|\.[0-9]{1,20})([eE][+-]?[0-9]{1,3})?")  # as sensors write one
UNIT, NOTHING = "CELSIUS", "UNAVAILABLE"  # of MTConnect
SHOWN = 40  # characters of what is no temperature
PORTS = {"mqtt": 1883, "mqtts": 8883}


class Watch:
    """Threads that ask or listen; `values` is what they know now."""

    def __init__(self, sensors: Sensors) -> None:
        """sensors of a cell → nothing is asked yet. Raises InputError where a library is missing."""
        self._sensors, self._stop = sensors, threading.Event()
        self._known: dict[str, tuple[float, float]] = {}  # name: °C, when it came
        self._strange: dict[str, str] = {}  # name: what it said last that is no temperature in °C
        self._clients: list[Any] = []
        self._mqtt: Any = None
        if any(sensor.way == "mqtt" for sensor in sensors.sensors):
            try:
                from paho.mqtt import client
            except ImportError:
                raise InputError("sensors.yaml: mqtt needs the library paho-mqtt: pip install 'tango-cnc[notify]'") from None
            self._mqtt = client

    def start(self) -> None:
        """Begins to ask and to listen; returns at once."""
        for sensor in self._sensors.sensors:
            if sensor.way == "mqtt":
                self._listen(sensor)
        urls = {sensor.url for sensor in self._sensors.sensors if sensor.way == "mtconnect"}
        for url in sorted(urls):
            threading.Thread(target=self._poll, args=(url,), daemon=True).start()

    def values(self) -> dict[str, float | None]:
        """→ {name: °C} now, None for what nobody has said lately."""
        now, found = time.monotonic(), dict(self._known)
        fresh = {name: value for name, (value, came) in found.items() if now - came <= self._sensors.old}
        return {sensor.name: fresh.get(sensor.name) for sensor in self._sensors.sensors}

    def strange(self) -> dict[str, str]:
        """→ {name: what it said last} of sensors that have no value now though they speak: no temperature in °C."""
        known, found = self.values(), dict(self._strange)
        return {name: text for name, text in found.items() if known.get(name) is None}

    def close(self) -> None:
        """Ends all of it."""
        self._stop.set()
        for client in self._clients:
            with contextlib.suppress(Exception):
                client.disconnect()
                client.loop_stop()

    def _came(self, name: str, text: str) -> None:
        if NUMBER.fullmatch(text):  # else UNAVAILABLE, an error message
            value = float(text)
            if math.isfinite(value) and COLDEST <= value <= HOTTEST:
                self._known[name] = value, time.monotonic()
                self._strange.pop(name, None)
                return
        self._known.pop(name, None)
        if text and text.upper() != NOTHING:
            self._strange[name] = "".join(c for c in text[:SHOWN] if c.isprintable())

    def _poll(self, url: str) -> None:
        while not self._stop.is_set():
            with contextlib.suppress(Exception):  # an agent that is gone: its values grow old
                with urllib.request.urlopen(url, timeout=ANSWER) as answer:
                    data = answer.read(LARGEST + 1)
                items = current(data)
                for sensor in self._sensors.sensors:
                    if sensor.url == url:
                        self._came(sensor.name, items.get(sensor.item, ""))
            self._stop.wait(self._sensors.every)

    def _listen(self, sensor: Sensor) -> None:
        parts = urlsplit(sensor.url)
        client = self._mqtt.Client(self._mqtt.CallbackAPIVersion.VERSION2)
        topic = unquote(parts.path.lstrip("/"))

        def message(_client: Any, _data: Any, message: Any) -> None:
            # a retained message may be of yesterday
            if not message.retain and len(message.payload) <= LARGEST:
                self._came(sensor.name, payload(message.payload, sensor.key))

        client.on_connect = lambda client, *_: client.subscribe(topic)
        client.on_message = message
        if parts.username:
            client.username_pw_set(unquote(parts.username), sensor.password or None)
        if parts.scheme == "mqtts":
            client.tls_set()
        with contextlib.suppress(Exception):
            client.connect_async(parts.hostname or "", parts.port or PORTS[parts.scheme])
            client.loop_start()
        self._clients.append(client)


def current(data: bytes) -> Mapping[str, str]:
    """answer of an MTConnect agent to /current → {dataItemId and name of a data item: its value}.

    One in another unit than °C has that behind its value, which is no number then; a name that two items have has no value.
    Raises ValueError for one that is too large, is no XML or declares a document type, which is how entities come in.
    """
    if len(data) > LARGEST:
        raise ValueError(f"more than {LARGEST} bytes")
    found: dict[str, str] = {}
    void: set[str] = set()
    units: dict[str, str] = {}  # of those in another one
    names: list[list[str]] = []  # of the elements that are open

    def begun(_tag: str, attributes: Mapping[str, str]) -> None:
        own = (attributes[key] for key in ("dataItemId", "name") if "dataItemId" in attributes and key in attributes)
        mine = list(dict.fromkeys(own))  # many agents give an item the same word for both
        unit = attributes.get("units", UNIT).upper()
        void.update(name for name in mine if name in found)
        units.update(dict.fromkeys(mine if unit != UNIT else (), unit))
        names.append(mine)
        found.update(dict.fromkeys(mine, ""))

    def text(piece: str) -> None:
        for name in names[-1]:
            found[name] += piece.strip()

    def declared(*_: Any) -> None:
        raise ValueError("a document type")

    parser = expat.ParserCreate()
    parser.StartElementHandler, parser.CharacterDataHandler, parser.StartDoctypeDeclHandler = begun, text, declared
    parser.EndElementHandler = lambda _tag: names.pop() and None
    parser.buffer_text = True
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        raise ValueError(str(error)) from None
    other = {name: f"{found[name]} {unit}".strip() if found[name].upper() != NOTHING else NOTHING for name, unit in units.items()}
    return found | other | dict.fromkeys(void, "")


def payload(data: bytes, key: str) -> str:
    """message, key of a JSON object in it or none → the text of the value; empty where there is none."""
    try:
        text = data.decode("utf-8")
        if not key:
            return text.strip()
        said = json.loads(text)
        value = said.get(key) if isinstance(said, dict) else None
        return str(value) if isinstance(value, int | float | str) and not isinstance(value, bool) else ""
    except (ValueError, RecursionError):
        return ""
