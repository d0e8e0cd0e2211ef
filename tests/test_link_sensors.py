"""Temperatures of the shop beside a run: an MTConnect agent, a real MQTT broker, and what happens when they fail."""

import contextlib
import getpass
import http.server
import json
import math
import re
import shutil
import subprocess
import threading
import time

import numpy as np
import pytest
from paho.mqtt import client as mqtt
from paho.mqtt import publish
from support.remote import free_port, listening
from support.runs import Control, Result, cell, readings  # noqa: F401

from tango_cnc.commands.init import write_example
from tango_cnc.files import read_cell
from tango_cnc.files.plan import read_plan
from tango_cnc.link.sensors import Sensor, Sensors, read_sensors
from tango_cnc.link.transport._sensors import LARGEST, Watch, current, payload
from tango_cnc.records import InputError
from tango_cnc.touches import from_readings

STREAM = """<?xml version="1.0"?>
<MTConnectStreams xmlns="urn:mtconnect.org:MTConnectStreams:1.3"><Streams><DeviceStream name="one"><ComponentStream>
<Samples><Temperature dataItemId="t1" name="bed" timestamp="2026-05-01T06:00:00Z">{bed}</Temperature>
<Temperature dataItemId="t2" timestamp="2026-05-01T06:00:00Z">UNAVAILABLE</Temperature></Samples>
</ComponentStream></DeviceStream></Streams></MTConnectStreams>"""


@pytest.fixture
def agent():
    """What stands in for an agent: its url and, in `says`, its answer."""

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200)
            self.end_headers()
            self.wfile.write(server.says)

        def log_message(self, *_):
            pass

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.says, server.url = STREAM.format(bed=21.5).encode(), f"http://127.0.0.1:{server.server_port}/current"
    threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True).start()
    yield server
    server.shutdown()


def until(condition):
    for _ in range(3000):
        if condition():
            return
        time.sleep(0.02)
    raise AssertionError("it has not happened")


def test_a_run_notes_the_temperatures_and_leaves_empty_what_nobody_says(cell, agent, monkeypatch):
    told, came = threading.Event(), Watch._came

    def coming(self, name, text):
        came(self, name, text)
        if name == "bed":
            told.set()

    def edit(number, line):
        """The control measures its first touch at once, and the others when a temperature is known."""
        assert number == 1 or told.wait(60)
        return line

    monkeypatch.setattr(Watch, "_came", coming)
    (cell / "sensors.yaml").write_text(
        f"sensors:\n  bed: {{mtconnect: '{agent.url}', item: bed}}\n  oil: {{mtconnect: '{agent.url}', item: t2}}\n"
        f"  gone: {{mtconnect: 'http://127.0.0.1:{free_port()}/current', item: x}}\n"
    )
    control = Control(cell, edit=edit)
    result = Result("run", "-C", cell, "--port", control.url, "--timeout", "20")
    assert result.code == 0, result.err
    got = readings(cell)
    assert set(got.temperatures) == {"bed", "oil", "gone"}
    assert got.temperatures["bed"][-1] == 21.5
    assert np.isnan(got.temperatures["oil"]).all() and np.isnan(got.temperatures["gone"]).all()
    assert "nan" not in (cell / "readings.csv").read_text()
    made = read_cell(cell)
    whole = not np.isnan(got.temperatures["bed"]).any()
    assert set(from_readings(made.machine, made.artefact, got).temperatures) == (
        {"bed"} if whole else set()
    )  # the sensors of diagnose


def test_an_item_whose_id_is_its_name_is_read_once():
    """Its number came twice, one after the other, and was none: every temperature of such an agent was empty."""
    page = b'<S><T dataItemId="bed" name="bed">19.5</T><T dataItemId="o1" name="oil">31</T></S>'
    assert dict(current(page)) == {"bed": "19.5", "o1": "31", "oil": "31"}


def test_a_value_that_is_unavailable_or_old_is_not_kept(agent):
    watch = Watch(Sensors((Sensor("bed", "mtconnect", agent.url, "t1"),), every=0.05, old=0.5))
    watch.start()
    until(lambda: watch.values() == {"bed": 21.5})
    agent.says = STREAM.format(bed="UNAVAILABLE").encode()
    until(lambda: watch.values() == {"bed": None})
    agent.says = STREAM.format(bed=22).encode()
    until(lambda: watch.values() == {"bed": 22.0})
    agent.says = b"out of order"
    until(lambda: watch.values() == {"bed": None})  # it has grown old
    watch.close()


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"<a",
        b"{}",
        b'<!DOCTYPE a [<!ENTITY b "21.5">]><a dataItemId="t">&b;</a>',
        '<!DOCTYPE a><a dataItemId="t">1</a>'.encode("utf-16"),
        b'<a dataItemId="t">1</a>' + b" " * LARGEST,
    ],
)
def test_an_answer_that_is_no_agents_is_refused(data):
    with pytest.raises(ValueError):
        current(data)


def test_no_answer_however_it_is_spoilt_is_a_temperature_of_nothing():
    watch = Watch(Sensors((Sensor("bed", "mtconnect", "http://x/", "t1"),)))
    for text in ("nan", "inf", "1e9", "-273", "", "21,5", "UNAVAILABLE"):
        watch._came("bed", text)
        assert watch.values() == {"bed": None}, text


@pytest.mark.parametrize(
    ("data", "key", "said"),
    [
        (b"21.5\n", "", "21.5"),
        (b'{"celsius": 21.5}', "celsius", "21.5"),
        (b'{"celsius": true}', "celsius", ""),
        (b"[1]", "celsius", ""),
        (b"{", "celsius", ""),
        (b"\xff", "", ""),
        (b"[" * 100_000, "celsius", ""),
    ],
)
def test_what_a_message_says(data, key, said):
    assert payload(data, key) == said


@pytest.mark.system("mosquitto")
def test_messages_of_a_broker_count_and_kept_ones_do_not(tmp_path):
    port = free_port()
    (tmp_path / "conf").write_text(f"listener {port} 127.0.0.1\nallow_anonymous true\npersistence false\n")
    command = [shutil.which("mosquitto"), "-c", tmp_path / "conf"]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as broker:
        try:
            listening(port, broker)
            publish.single("shop/room", "19.0", retain=True, hostname="127.0.0.1", port=port)
            url = f"mqtt://127.0.0.1:{port}/shop"
            room, oil = Sensor("room", "mqtt", f"{url}/room"), Sensor("oil", "mqtt", f"{url}/oil", key="celsius")
            watch = Watch(Sensors((room, oil)))
            watch.start()

            def said():
                publish.single("shop/oil", json.dumps({"celsius": 30.25}), hostname="127.0.0.1", port=port)
                return watch.values()["oil"] == 30.25

            until(said)
            assert watch.values()["room"] is None
            publish.single("shop/room", "19.5", hostname="127.0.0.1", port=port)
            until(lambda: watch.values()["room"] == 19.5)
        finally:
            broker.terminate()
    watch.close()
    assert math.isclose(watch.values()["room"], 19.5)  # the broker is gone, the value not yet old


@pytest.mark.long
@pytest.mark.system("mosquitto", "mosquitto_passwd")
def test_a_broker_that_asks_for_a_password_dies_and_comes_back(tmp_path):
    """Who has the password hears; values of a broker that is gone grow old, and come again with it."""
    port, word = free_port(), "geheim9"
    subprocess.run(["mosquitto_passwd", "-b", "-c", tmp_path / "words", "anna", word], check=True, capture_output=True)
    user = f"user {getpass.getuser()}\n"  # whose files these are
    (tmp_path / "conf").write_text(
        f"listener {port} 127.0.0.1\nallow_anonymous false\npassword_file {tmp_path / 'words'}\npersistence false\n{user}"
    )
    url = f"mqtt://anna@127.0.0.1:{port}/shop/room"
    sensors = Sensors((Sensor("room", "mqtt", url, password=word), Sensor("other", "mqtt", url, password="x")), old=1.0)

    def broker():
        process = subprocess.Popen(["mosquitto", "-c", tmp_path / "conf"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        listening(port, process)
        return process

    def says(value):
        account = {"username": "anna", "password": word}
        publish.single("shop/room", value, hostname="127.0.0.1", port=port, auth=account)
        return watch.values()["room"] == float(value)

    watch, first = Watch(sensors), broker()
    try:
        watch.start()
        until(lambda: says("19.5"))
        first.kill()
        first.wait()
        until(lambda: watch.values()["room"] is None)
        first = broker()
        for _ in range(5):  # paho waits a second, then two, between two attempts
            with contextlib.suppress(AssertionError):
                until(lambda: says("20.5"))
                break
        assert watch.values() == {"room": 20.5, "other": None}
    finally:
        watch.close()
        first.kill()
        first.wait()


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("sensors: {bed: {mtconnect: 'ftp://x/current', item: a}}", "http://"),
        ("sensors: {'a b': {mtconnect: 'http://x/current', item: a}}", "letters, digits and _"),
        ("sensors: {bed: {mqtt: 'mqtt://x'}}", "mqtt://"),
        ("sensors: {bed: {mqtt: 'mqtt://x/a', item: b}}", "item"),
        ("every: 0\nsensors: {}", "every"),
    ],
)
def test_a_file_of_sensors_that_is_wrong_is_named_with_its_line(tmp_path, text, why):
    (tmp_path / "sensors.yaml").write_text(text)
    with pytest.raises(InputError, match=rf"sensors\.yaml:\d+.*{why}"):
        read_sensors(tmp_path)


def test_a_file_of_sensors_that_is_wrong_ends_a_run_before_anything_is_written(cell):
    (cell / "sensors.yaml").write_text("sensors: {bed: {mqtt: 'mqtt://x'}}")
    before = sorted(cell.rglob("*"))
    result = Result("run", "-C", cell, "--port", "socket://127.0.0.1:1")
    assert result.code == 2 and "sensors.yaml:1" in result.err
    assert sorted(cell.rglob("*")) == before


@pytest.mark.few(0)
def test_diagnose_says_which_sensor_has_gaps(cell):
    made = Result("simulate", "-C", cell, "-o", cell / "simulated.csv")
    assert made.code == 0, made.err
    head, *rows = (cell / "simulated.csv").read_text().splitlines()
    texts = [f"{row},{'' if i < 3 else 21 + i},{20 + i}" for i, row in enumerate(rows)]
    (cell / "mine.csv").write_text("\n".join([f"{head},T_bed,T_oil", *texts]) + "\n")
    result = Result("diagnose", "-C", cell, "--despite", "--readings", cell / "mine.csv")
    assert "sensor T_bed is not used: 3 of 7 touches have no value" in result.err and "T_oil is not used" not in result.err


class Warming(Control):
    """A machine whose tool drifts with the temperature of its bed: 1.2 µm/K in X, -0.8 in Z; every reading has noise."""

    DRIFT = np.array([0.0012, 0.0, -0.0008])  # mm/K

    def __init__(self, folder, publish):
        self._publish, self._chance = publish, np.random.default_rng(5)
        self.planned = read_plan(folder / "program" / "plan.csv", read_cell(folder).machine)
        self.whole = len(self.planned.touch)
        self._levels = self._chance.uniform(18, 26, len(self.planned.touch) // 8 + 1)
        super().__init__(folder, edit=self._edit)

    def _edit(self, number, line):
        i = list(self.planned.touch).index(number)
        journal = self.folder / "readings.journal"
        until(lambda: i == 0 or journal.read_text().count('"kind":"reading"') >= i)  # the touch before is on disk
        bed = self._levels[i // 8]
        self._publish(bed)
        away = (self.planned.contact[i] - self.planned.standoff[i])[:3]
        away /= np.linalg.norm(away)
        moved = away * (away @ self.DRIFT * (bed - 20.0) + self._chance.normal(0.0, 0.0006))
        values = {word[0]: float(word[1:]) for word in line.split()}
        values |= {name: values[name] + moved[k] for k, name in enumerate("XYZ")}
        values["K"] = sum(v for name, v in values.items() if name not in "PHK")
        places = " ".join(f"{name}{value:.4f}" for name, value in values.items() if name not in "PH")
        return f"P{number} H1 {places}"


@contextlib.contextmanager
def over_mqtt(request, tmp_path):
    """→ entry of sensors.yaml, who publishes a text; a real broker stands between."""
    port = free_port()
    (tmp_path / "conf").write_text(f"listener {port} 127.0.0.1\nallow_anonymous true\npersistence false\n")
    with subprocess.Popen(["mosquitto", "-c", tmp_path / "conf"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as broker:
        try:
            listening(port, broker)
            sender = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2)
            sender.connect("127.0.0.1", port)
            sender.loop_start()
            yield f"{{mqtt: 'mqtt://127.0.0.1:{port}/shop/bed'}}", lambda text: sender.publish("shop/bed", text, qos=1)
            sender.loop_stop()
        finally:
            broker.terminate()


@contextlib.contextmanager
def over_mtconnect(request, tmp_path):
    """→ entry of sensors.yaml, who lets the agent answer a text; it is asked over HTTP every half second."""
    agent = request.getfixturevalue("agent")

    def publish(text):
        agent.says = STREAM.format(bed=text).encode()

    yield f"{{mtconnect: '{agent.url}', item: bed}}", publish


@pytest.mark.long
@pytest.mark.parametrize("way", [pytest.param(over_mqtt, marks=pytest.mark.system("mosquitto")), over_mtconnect])
def test_a_drift_that_follows_a_temperature_is_named_with_its_sensor(request, tmp_path, monkeypatch, way):
    """Sensor, run, readings, diagnosis: the temperature comes over MQTT or MTConnect while the touches are made."""
    folder = tmp_path / "cell"
    write_example(folder, "hu40t")
    head, *indexations = re.split(r"(?m)^(?=- )", (folder / "strategy.yaml").read_text())
    (folder / "strategy.yaml").write_text(head + "".join(indexations[:14]))
    (folder / "world.yaml").unlink()
    assert Result("plan", "-C", folder).code == 0
    came, wanted, real, started = threading.Event(), [""], Watch._came, Watch.start

    def heard(self, name, text):
        real(self, name, text)
        if text == wanted[0]:
            came.set()

    monkeypatch.setattr(Watch, "_came", heard)
    with way(request, tmp_path) as (entry, publish):
        (folder / "sensors.yaml").write_text(f"every: 0.5\nsensors:\n  bed: {entry}\n")

        def say(bed):
            if wanted[0] != (text := f"{bed:.3f}"):
                came.clear()
                wanted[0] = text
                publish(text)
                assert came.wait(20)

        def start(self):  # the shop's sensor speaks before the first touch
            started(self)
            wanted[0] = "20.000"
            until(lambda: (publish("20.000"), came.wait(0.1))[1])

        monkeypatch.setattr(Watch, "start", start)
        control = Warming(folder, say)
        result = Result("run", "-C", folder, "--port", control.url, "--timeout", "60")
    assert result.code == 0, result.err
    found = Result("diagnose", "-C", folder, "--despite", "--json", "-")
    causes = json.loads(found.out)
    assert "is not used" not in found.err
    first = causes["findings"][0]
    assert (first["cause"], first["detail"]["sensor"]) == ("thermal_drift", "bed")
    true = np.abs(Warming.DRIFT) / np.linalg.norm(Warming.DRIFT)  # the table carries X: signs are those of tool against table
    assert np.abs(first["detail"]["direction"]) == pytest.approx(true, abs=0.1)


@pytest.mark.parametrize("text", ["1_0", "٢٣", "0x1F", "1e5000", "9" * 5000, "NaN", "21,5", ""])
def test_a_number_that_no_sensor_writes_is_no_temperature(text):
    watch = Watch(Sensors((Sensor("bed", "mtconnect", "http://127.0.0.1:1/current", "t1"),)))
    watch._came("bed", "21.5")
    assert watch.values() == {"bed": 21.5}
    watch._came("bed", text)
    assert watch.values() == {"bed": None}


@pytest.mark.parametrize(
    ("items", "said"),
    [
        ('<T dataItemId="t1" name="bed">22.0</T><T dataItemId="t1" name="oil">23.0</T>', {"t1": "", "bed": "22.0", "oil": "23.0"}),
        (
            '<T dataItemId="t1" name="bed" units="KELVIN">295.4</T><T dataItemId="t2">5</T>',
            {"t1": "295.4 KELVIN", "bed": "295.4 KELVIN", "t2": "5"},
        ),
        ('<T dataItemId="t1" units="CELSIUS">22.0</T>', {"t1": "22.0"}),
    ],
)
def test_a_name_of_two_items_and_another_unit_have_no_value(items, said):
    """The last of the two was taken, and kelvins were degrees."""
    assert current(f"<S>{items}</S>".encode()) == said


@pytest.mark.parametrize(
    ("attributes", "value", "strange"),
    [
        ("", "-300", {"bed": "-300"}),
        ("", "1e9", {"bed": "1e9"}),
        (' units="FAHRENHEIT"', "69.58", {"bed": "69.58 FAHRENHEIT"}),
        ("", "UNAVAILABLE", {}),
        (' units="FAHRENHEIT"', "UNAVAILABLE", {}),
        ("", "21.5", {}),
    ],
)
def test_what_a_sensor_says_that_is_no_temperature_is_kept_as_it_said_it(attributes, value, strange):
    """The night called such a sensor silent, and the shop looked for a dead cable."""
    watch = Watch(Sensors((Sensor("bed", "mtconnect", "http://127.0.0.1:1/current", "t1"),)))
    watch._came("bed", current(f'<S><T dataItemId="t1"{attributes}>{value}</T></S>'.encode())["t1"])
    assert watch.strange() == strange and (watch.values()["bed"] == 21.5) == (value == "21.5")
    watch._came("bed", "20.0")
    assert watch.strange() == {}


def test_a_run_notes_what_a_sensor_said_that_is_no_temperature(cell, agent):
    agent.says = STREAM.format(bed=-300).encode()
    (cell / "sensors.yaml").write_text(
        f"every: 0.5\nsensors:\n  bed: {{mtconnect: '{agent.url}', item: bed}}\n  oil: {{mtconnect: '{agent.url}', item: t2}}\n"
    )
    came, asked = threading.Event(), agent.RequestHandlerClass.do_GET

    def answer(self):
        asked(self)
        came.set()

    agent.RequestHandlerClass.do_GET = answer

    def edit(number, line):
        assert came.wait(60)
        return line

    control = Control(cell, edit=edit)
    result = Result("run", "-C", cell, "--port", control.url, "--timeout", "20")
    assert result.code == 0, result.err
    assert json.loads((cell / "readings.json").read_text())["no_temperature"] == {"bed": "-300"}
