"""Every kind of file that a command reads: a small good one, and what reads it."""

from __future__ import annotations

import json
import math
import os
import random
import re
import zlib
from collections.abc import Callable
from dataclasses import fields
from datetime import date
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import postprocessors as posts
from sim_controller import compensation
from support.besides import BESIDES
from support.brought import BROUGHT
from support.databases import DATABASES
from support.mutants import Reader, spoilt
from support.shopfiles import SHOP
from support.tables import TABLES
from support.trust_parts import run_of
from tango_cnc import conformity
from tango_cnc.acceptance import read_order
from tango_cnc.asked import as_run, asked
from tango_cnc.commands._import import imported
from tango_cnc.commands._present import values_of
from tango_cnc.commands._program import language_of, opened
from tango_cnc.commands._trusted import known
from tango_cnc.commands.report import compensations, paper
from tango_cnc.compensate import loop
from tango_cnc.compensate.hidden import of_record
from tango_cnc.design.facets import mesh, of_hull
from tango_cnc.diagnose.table import read_table
from tango_cnc.files import origin, read_cell, read_readings, read_world
from tango_cnc.files.commissioning import Proof, add_proofs, read_commissioning
from tango_cnc.files.hull import read_hull
from tango_cnc.files.learned import learned
from tango_cnc.files.nightly import read_nightly
from tango_cnc.files.plan import plan_lines, read_plan
from tango_cnc.files.targets import sources, spared
from tango_cnc.instruments import read_measured
from tango_cnc.iso230.temperature import read_thermal
from tango_cnc.link.entries import End, ProgramSent, Reading, StartMark
from tango_cnc.link.journal import Journal, digest_of, look_at, read_journal, salvaged
from tango_cnc.link.layout import STANDARD, read_layout
from tango_cnc.link.measure import protocol_of
from tango_cnc.link.nodes import STANDARD as NODES
from tango_cnc.link.nodes import read_nodes
from tango_cnc.link.sensors import read_sensors
from tango_cnc.link.transport._sensors import current, payload
from tango_cnc.nc import features
from tango_cnc.nc.follow import Setup, follow
from tango_cnc.plan import plan, plan_hash
from tango_cnc.program import from_file
from tango_cnc.records import Cell, InputError, Plan, TangoError
from tango_cnc.report.texts import texts_of
from tango_cnc.uncertainty.inputs import read_budget
from tango_cnc.verify.cmm import read_cmm
from tango_cnc.web.users import FORMAT as USERS
from tango_cnc.web.users import read_users

UTC = "2026-05-01T06:00:00.000+00:00"
TEXTS = {
    "tango.yaml": """\
tango: 1
machine: machine.yaml
artefact: artefact.yaml
strategy: strategy.yaml
terms: [S2, EYX2, {cause: thermal_drift, tau: 2400}, {cause: learned, name: bend}]
controller: {post: fanuc, port: "socket://127.0.0.1:8193", program_number: 8700, confirmed: []}
""",
    "machine.yaml": """\
name: small
topology: wCBXfZY(S)t
axes:
  X: {kind: linear, direction: [1, 0, 0], travel: [-400, 400]}
  Y: {kind: linear, direction: [0, 1, 0], travel: [-350, 350], rapid: 20000, acceleration: 2.5}
  Z: {kind: linear, direction: [0, 0, 1], travel: [-100, 800]}
  B: {kind: rotary, direction: [0, 1, 0], point: [0, 0, 0], travel: [-95, 95], rapid: 3600, clamp_time: 1.5}
  C: {kind: rotary, direction: [0, 0, 1], point: [0, 0, 0], travel: [-365, 365]}
  S: {kind: spindle, direction: [0, 0, 1], point: [0, 0, 0]}
probe: {length: 326.674, tip_radius: 3.0, repeatability: 0.0007, stylus_radius: 1, body_radius: 20, body_length: 60}
tolerances: {location: 0.5, angle: 0.1}
""",
    "artefact.yaml": """\
name: cube
facets:
  1: {point: [100, 0, 0], normal: [1, 0, 0]}
  2: {point: [0, 100, 0], normal: [0, 1, 0]}
  top: {point: [0, 0, 20], normal: [0, 0, 1], uncertainty: 0.0005}
  3: {point: [-100, 0, 0], normal: [-1, 0, 0]}
  4: {point: [0, -100, 0], normal: [0, -1, 0]}
  5: {point: [100, 50, 0], normal: [1, 0, 0]}
  6: {point: [50, 50, 20], normal: [0, 0, 1]}
  7: {point: [50, 100, 0], normal: [0, 1, 0]}
  11: {point: [50, 0, 72.7], normal: [0, 0, 1], ball: 1}
balls:
  1: {centre: [50, 0, 60], radius: 12.7}
  2: {centre: [-50, 0, 60], radius: 12.7}
scale_bar: {balls: [1, 2], length: 100.001, uncertainty: 0.0005}
tolerances: {facet: 0.5}
""",
    "strategy.yaml": """\
name: two indexations
approach: {standoff: 10, search: 5, feed: 180, find: {feed: 800, retreat: 8.5}}
indexations:
  - {S: 0, B: 0, C: 0, facets: [1, 2, top, 11]}
  - {B: 30, C: -90, facets: [top, 1]}
""",
    "world.yaml": """\
errors: {EX0C: -0.108}
stylus: {EXt: 0.01}
facets: {1: 0.02}
noise: 0.0006
effects: [{cause: thermal_drift, amplitude: 0.01, tau: 2400, direction: [0, 1, 0]}, {cause: learned, name: bend}]
seed: 7
""",
    "readings.csv": """\
touch,time_s,facet,X,Y,Z,B,C,S,dX,dY,dZ,dB,dC,dS,status,cycle,day,feed,T_bed,segment
1,0.0,1,103,0,326,0,0,0,-1,0,0,0,0,0,ok,1,1,180,21.5,1
2,9.5,2,0,103,326,0,0,0,0,-1,0,0,0,0,miss,1,1,180,21.5,1
3,19.0,top,0,0,349.674,0,0,0,0,0,-1,0,0,0,ok,1,1,180,21.5,2
""",
    "learned/bend.yaml": """\
format: tango-learned/1
factors: [{covariate: X, kind: linear, low: -100, high: 100, count: 3}]
weight: point
values: [0.1, 0.2, -0.3]
text: the table bends
""",
    "readings.json": f"""\
{{"format": "tango-run/1", "plan_hash": "0A1B2C3D4E5F", "program_hash": "0A1B2C3D4E5F", "journal_hash": "00",
 "start_utc": "{UTC}", "end_utc": "{UTC}", "machine": "small", "touches": 3, "time_s": 19.5}}
""",
    "sensors.yaml": """\
every: 5
old: 60
sensors:
  bed: {mtconnect: "http://192.168.1.30:5000/current", item: bed_temperature}
  coolant: {mqtt: "mqtts://anna@192.168.1.40:8883/shop/coolant", key: celsius, password: "env:HOME"}
""",
    "nightly.yaml": """\
nightly: 1
history: history.db
owner: Ann
check_minutes: 6
limits: {volume: 30, EX0C: 25}
sensor: bed
temperature: [15, 30]
free_mb: 200
commissioned: false
notify: ["mailto:ann@example.org", "file:///tmp/x"]
""",
    "uncertainty.yaml": """\
contributions:
  - {source: repeatability, std: 0.0006}
  - {source: drift, shape: random_walk, amplitude: 0.002}
  - {source: lobing, amplitude: 0.0035, order: 2}
  - {source: rotary_positioning, axis: B, std: 0.0003}
""",
    "temperature.yaml": "bar: [23.0, 0.1]\nmachine: [25.0, 0.3]\nbar_expansion: [11.5, 0.6]\nmachine_expansion: [10.5, 1.0]\n",
    "acceptance.yaml": """\
limits: {straightness EXZ: 10, squareness EC(0X)Y: 40}
tool_length: 326.674
laboratory: Measuring room
customer: production
performed: 2026-11-23
conditions: {machine_temperature: 20.4 °C, air_temperature: 20.8 °C, warm_up: 2 h}
certificates:
  - {of: scale bar, number: C-123, date: 2026-01-10, value: 304.6686 mm, uncertainty: 1.0 µm, k: 2, issued_by: NN}
remarks: none
""",
    "limits.yaml": "limits:\n  EX0C: 0.010\n  EB0Z: [-2.0e-5, 1.0e-5]\n  EA0Y: [null, 3]\n",
    "features.yaml": """\
places: {A: N20, B: {X: 1.5, Y: 2}, C: N40, D: N50}
point_um: 1.5
checks:
  - {name: pitch, kind: distance, of: [A, B]}
  - {kind: squareness, of: [A, B, A, D]}
  - {kind: position, of: B, datum: [A, C, D]}
  - {kind: circularity, of: N95}
""",
    "present.yaml": "machine: M\nEX0C: 0.01\n'3,4': -2.5\n",
    "texts.toml": 'language = "en"\n[report]\n',
    "cmm.csv": "facet,x,y,z\n1,100.001,0,0\n2,0,100,0\ntop,0,0,20\n3,-100,0,0\n1,100.01,5,0\n4,0,-100,0\n"
    "5,100,50,0\n6,50,50,20\n7,50,100,0\n",
    "table.csv": "y,x,day,kind\n" + "".join(f"{0.1 * i},{i * i},{i % 2},{'ab'[i % 2]}\n" for i in range(9)),
    "users.json": json.dumps({"format": USERS, "users": {"anna": {"hash": "$argon2id$x", "role": "view"}}}),
    "trusted-posts.txt": "ab" * 32 + " /cell/mine.py\n",
    "compensations/history.jsonl": json.dumps({"utc": UTC, "compensation": 1, "target": "fanuc", "event": "written"}) + "\n",
    "plate.obj": "v 0 0 0\nv 10 0 0\nv 0 10 0\nv 0 0 10\nf 1 2 3\nf 1 2 4\nf 2 3 4\nf 1 3 4\n",
}
PLY = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement face 4\n"
PLY += "property list uchar int vertex_indices\nend_header\n0 0 0\n10 0 0\n0 10 0\n0 0 10\n3 0 1 2\n3 0 1 3\n3 1 2 3\n3 0 2 3\n"
STL = "solid a\n" + 4 * (
    " facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n   vertex 10 0 0\n   vertex 0 10 3.5\n  endloop\n endfacet\n"
)
STL = STL.replace("vertex 0 10 3.5", "vertex 0 0 12", 1) + "endsolid a\n"
CELL = ("tango.yaml", "machine.yaml", "artefact.yaml", "strategy.yaml", "world.yaml", "readings.csv", "learned/bend.yaml")


def cell(folder: Path) -> None:
    """empty folder → a cell in it."""
    for name in CELL:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(TEXTS[name], encoding="utf-8")


@cache
def whole(folder: Path) -> Cell:
    """folder → its cell, read once, for readers of other files."""
    return read_cell(folder)


@cache
def planned(folder: Path) -> Plan:
    """folder → the plan of its cell, made once."""
    return plan(whole(folder))


def _program(folder: Path) -> bytes:
    return "\n".join([*_posted(folder)[2](), ""]).encode()


def _posted(folder: Path) -> Any:
    return posts.program(posts.load("fanuc"), planned(folder), {}, plan_hash(planned(folder)))


def _journal(folder: Path) -> bytes:
    file = folder / "made.journal"
    file.unlink(missing_ok=True)
    journal = Journal(file, [])
    journal.add(ProgramSent(UTC, "1", "small", {"post": "fanuc", "port": "x"}, "0A", "0B", (1, 2)))
    journal.add(StartMark(UTC, 0.0, "boot", 12.5))
    journal.add(Reading(1, "top", (1.0, 2.5), 1.5, "ok", 0.5, None, (1, -1), "P1 H1 X1"))
    journal.add(End(True, "done", UTC))
    journal.close()
    return file.read_bytes()


def _commissioning(folder: Path) -> bytes:
    add_proofs(folder, "fanuc", [Proof("alive", "PASS", "found", 0.5, "mm", UTC, "0A", "", "0B")])
    return (folder / "commissioning.yaml").read_bytes()


def _origin(folder: Path) -> bytes:
    origin.write_origin(folder / "readings.csv", folder, "measured", None, {"start_utc": UTC, "end_utc": UTC})
    return origin.origin_file(folder / "readings.csv").read_bytes()


def _origins(folder: Path) -> Any:
    file = folder / "readings.csv"
    known = origin.look_up(file)
    return [origin.read_origin(file) and None, origin.simulated(file), origin.edited_rows(known), origin.hurried(known),
            origin.changed_keys(known, folder)]  # fmt: skip


def _kept(record: dict[str, Any]) -> bytes:
    """record of a compensation → its file, as it is written."""
    return (json.dumps(record | {"digest": loop.digest(record)}, indent=1, ensure_ascii=False) + "\n").encode()


def _record(folder: Path) -> bytes:
    (folder / "compensations" / "001-a").mkdir(parents=True, exist_ok=True)
    (folder / "compensations" / "001-a" / "a.txt").write_text("x\n", encoding="utf-8")
    value = {"place": "p", "table": "t", "unit": "mm", "present": 0.0, "new": 0.5, "increment": 0.001}
    figure = {"value": 30.0, "low": 28.0, "high": 32.0}
    record = {"format": loop.FORMAT, "target": "fanuc", "files": {"a.txt": "x\n"}, "undo": {}, "values": [value]}
    record |= {"machine": "small", "topology": "wCBXfZY(S)t", "options": {"points": 3}, "volume": {"X": [-100.0, 100.0]}}
    record |= {"promise": {"rms_before_um": figure, "rms_after_um": figure, "p95_before_um": figure, "p95_after_um": figure}}
    record |= {"created_utc": UTC, "steps": ["1. load it"], "readings_rows": ["00ff"], "over": "probed", "present_given": True}
    (folder / "compensations" / "001-a" / "steps.txt").write_text("1. load it\n", encoding="utf-8")
    return _kept(record)


def _records(folder: Path) -> Any:
    found = [(kept.number, of_record(loop.check(kept.folder)), kept.record["values"]) for kept in loop.found(folder)]
    return found, loop.state(folder, 1), compensations(folder), [loop.older(loop.one(folder, 1).record, ["00ff"], UTC)]


def _journals(folder: Path) -> Any:
    file = folder / "readings.journal"
    return salvaged(look_at(file)), read_journal(file)


def _profile(folder: Path) -> Any:
    cell = read_cell(folder)
    if cell.controller is None or posts.is_own(cell.controller.post):
        return None
    post = posts.load(cell.controller.post, "controller.post")
    posts.unverified(post, cell.controller.options)
    return posts.settings(post, cell.controller.options)


def _sent(folder: Path) -> Any:
    return [from_file(folder / "O8700.nc", posts.load("fanuc"), planned(folder), {}).unread]


def _followed(folder: Path) -> Any:
    """The motions of a shop's program."""
    file, cell = folder / "part.nc", whole(folder)
    language = language_of(file, cell, None)
    with opened(file) as text:
        return list(follow(text, language, Setup(cell.machine, dict.fromkeys(cell.machine.names, 0.0), 100.0)))


def _as_run(folder: Path) -> Any:
    cell, run = whole(folder), run_of(folder / "readings.csv")
    return [asked(cell, run), as_run(cell, run).strategy]


def _cell(folder: Path) -> Any:
    file = folder / "other.yaml"
    file.touch()
    spared("-o", file, folder)
    return read_cell(folder), [str(one) for one in sources(folder)]


def _measured(folder: Path) -> Any:
    cell = whole(folder)
    found = read_readings(folder / "readings.csv", cell.machine, cell.artefact)
    temperatures = [value for values in found.temperatures.values() for value in values]
    text = (folder / "readings.csv").read_bytes().decode("utf-8", "replace")
    gaps = re.findall(r"(?m)(?:,|^)[\s\"]*(?=,|$)", text)  # cells without a value
    if np.isnan(temperatures).sum() <= len(gaps):
        temperatures = [value for value in temperatures if not math.isnan(value)]
    others = {field.name: getattr(found, field.name) for field in fields(found) if field.name != "temperatures"}
    return others, temperatures, _origins(folder)


def _trusted(folder: Path) -> bool:
    file = Path(os.environ["XDG_CONFIG_HOME"], "tango", "trusted-posts.txt")
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes((folder / "trusted-posts.txt").read_bytes())
    return known(folder / "tango.yaml")


PORTS = (
    "serial:///dev/ttyUSB0?baud=9600&bits=7&parity=even&stop=2&flow=xonxoff",
    "modbus+tcp://[fe80::1]:502/1?run=program",
    "sftp://anna@192.168.1.20:22/records/TANGO.TXT?program=/programs/&password=env:HOME&hostkey=SHA256:abc",
    "lsv2://192.168.1.20/TNC:/TANGO.TXT?program=TNC:/&from=last",
    "opcua://192.168.1.20:4840?user=anna&password=env:HOME&program=ns=2;s=/FOLDER",
    "linuxcnc://127.0.0.1:5007?file=/tmp/tango.ngc&log=/tmp/tango-readings.txt",
    "file:///C:/control%20one/TANGO.TXT",
)
AGENT = b"""<?xml version="1.0"?><MTConnectStreams xmlns="urn:mtconnect.org:MTConnectStreams:1.3"><Streams><DeviceStream name="M">
<ComponentStream component="Base"><Samples><Temperature dataItemId="t1" name="bed">21.5</Temperature>
<Temperature dataItemId="t2">UNAVAILABLE</Temperature></Samples></ComponentStream></DeviceStream></Streams></MTConnectStreams>"""


def _port(folder: Path) -> Any:
    """The lines of a file, one port's URL each."""
    text = (folder / "ports.txt").read_bytes().decode("utf-8", "replace")
    for line in text.split("\n"):
        if line not in PORTS or text == "\n".join(PORTS):
            protocol_of(line, "dnc")


def _agent(folder: Path) -> Any:
    try:
        return dict(current((folder / "current.xml").read_bytes())) and None
    except ValueError as error:  # which the watch takes for no value
        raise InputError(str(error)) from None


class _History:
    def machines(self) -> tuple[str, ...]:
        return ("small",)

    def nights(self, name: str) -> Any:
        raise InputError("as far as readings.json goes")


def _before(folder: Path) -> Any:
    made = paper(folder, folder / "readings.csv", "", "")
    try:
        list(imported(_History(), [folder], folder))  # type: ignore[arg-type]
    except InputError as error:
        if "as far as" not in str(error):
            raise
    return made.origin and None


def _text(name: str) -> Callable[[Path], bytes]:
    return lambda folder: TEXTS[name].encode()


RUN = {"format": "tango-run/1", "left_out": ["touch 3 on facet 4: too far"], "until": {"strategy": [
    {"position": {"S": 0.0, "B": 0.5, "C": 0.0}, "facets": ["1", "top"]}]}}  # fmt: skip
BAR = "angle_deg;direction;radial_um\n" + "".join(f"{30 * i},5;{'+-'[i % 2]};{1.5 * i:g}\n".replace(".", ",") for i in range(12))
PART = "%\nO17 (PART)\nG21 G90 G17 G54\nT1 M6\nG0 X0. Y0. Z50. S2000 M3\nG1 Z-2. F300.\nX40.5 Y10.\nG2 X50.5 Y20. I0. J10.\n"
PART += "G3 X40. Y30. R10.\nG0 Z50.\nX1.\nZ50.\nM30\n%\n"
TODAY = date(2026, 11, 23)


def chained(data: bytes, rng: random.Random) -> bytes:
    """journal → the same with something wrong in one line, its numbers, check sums and hashes made anew."""
    lines = [line.partition(b" ")[2] for line in data.split(b"\n") if line]
    at = rng.randrange(len(lines))
    lines[at] = spoilt(lines[at], rng).replace(b"\n", b" ")
    made, before = [], ""
    for text in lines:
        text = re.sub(rb'"before":"[0-9a-f]*"', b'"before":"%s"' % before.encode(), text)
        made.append(b"%08x %s" % (zlib.crc32(text), text))
        before = digest_of(made[-1])
    return b"".join(line + b"\n" for line in made)


def signed(data: bytes, rng: random.Random) -> bytes:
    """record of a compensation → the same with something wrong and its hash made anew."""
    made = spoilt(data, rng)
    try:
        record = json.loads(made)
        return _kept(record)
    except (ValueError, TypeError, RecursionError):
        return made


READERS = {
    **{name: Reader(name, _text(name), _cell) for name in ("tango.yaml", "machine.yaml", "artefact.yaml", "strategy.yaml")},
    "profile": Reader("tango.yaml", _text("tango.yaml"), _profile),
    "world.yaml": Reader("world.yaml", _text("world.yaml"), lambda f: read_world(f / "world.yaml")),
    "learned": Reader("learned/bend.yaml", _text("learned/bend.yaml"), lambda f: (learned(f), read_cell(f).terms)),
    "readings.csv": Reader("readings.csv", _text("readings.csv"), _measured),
    "readings.json": Reader("readings.json", _text("readings.json"), _before),
    "readings.origin.json": Reader("readings.origin.json", _origin, _origins),
    "readings.journal": Reader("readings.journal", _journal, _journals, chained),
    "commissioning.yaml": Reader("commissioning.yaml", _commissioning, read_commissioning),
    "nightly.yaml": Reader("nightly.yaml", _text("nightly.yaml"), read_nightly),
    "uncertainty.yaml": Reader("uncertainty.yaml", _text("uncertainty.yaml"), lambda f: read_budget(f / "uncertainty.yaml")),
    "temperature.yaml": Reader("temperature.yaml", _text("temperature.yaml"), lambda f: read_thermal(f / "temperature.yaml")),
    "acceptance.yaml": Reader("acceptance.yaml", _text("acceptance.yaml"), lambda f: read_order(f / "acceptance.yaml", TODAY)),
    "limits.yaml": Reader(
        "limits.yaml",
        _text("limits.yaml"),
        lambda f: conformity.read_limits(f / "limits.yaml", ["EX0C", "EB0Z", "EA0Y"]),
        limits=True,
    ),
    "features.yaml": Reader("features.yaml", _text("features.yaml"), lambda f: features.read(f / "features.yaml")),
    "present.yaml": Reader("present.yaml", _text("present.yaml"), lambda f: values_of(f / "present.yaml", "M")),
    "layout.yaml": Reader("layout.yaml", lambda f: Path(STANDARD).read_bytes(), lambda f: read_layout(str(f / "layout.yaml"))),
    "opcua.yaml": Reader("opcua.yaml", lambda f: NODES.read_bytes(), lambda f: read_nodes(str(f / "opcua.yaml"))),
    "sensors.yaml": Reader("sensors.yaml", _text("sensors.yaml"), read_sensors),
    "ports": Reader("ports.txt", lambda f: "\n".join(PORTS).encode(), _port),
    "current.xml": Reader("current.xml", lambda f: AGENT, _agent),
    "message": Reader(
        "message.json", lambda f: b'{"celsius": 21.5}', lambda f: payload((f / "message.json").read_bytes(), "celsius")
    ),
    "texts.toml": Reader("texts.toml", _text("texts.toml"), lambda f: texts_of(f).keys),
    "cmm.csv": Reader("cmm.csv", _text("cmm.csv"), lambda f: read_cmm(f / "cmm.csv", whole(f).artefact)),
    "table.csv": Reader(
        "table.csv", _text("table.csv"), lambda f: read_table(f / "table.csv", ["y"], ["x"], ["x:position", "kind:category"], "day")
    ),
    "plan.csv": Reader(
        "plan.csv",
        lambda f: "".join(f"{line}\n" for line in plan_lines(planned(f))).encode(),
        lambda f: read_plan(f / "plan.csv", whole(f).machine),
    ),
    "users.json": Reader("users.json", _text("users.json"), lambda f: read_users(f / "users.json")),
    "trusted-posts.txt": Reader("trusted-posts.txt", _text("trusted-posts.txt"), _trusted),
    "compensation": Reader("compensations/001-a/compensation.json", _record, _records, signed, (TangoError,)),
    "compensation-history": Reader("compensations/history.jsonl", _text("compensations/history.jsonl"), loop.history),
    "compensation-simulated": Reader("compensation.json", _record, lambda f: compensation.read(f, whole(f).machine) and None),
    "readings.json-of-a-run": Reader("readings.json", lambda f: json.dumps(RUN).encode(), _as_run),
    "ballbar.csv": Reader("ballbar.csv", lambda f: BAR.encode(), lambda f: read_measured(f / "ballbar.csv", ("radial",), True)),
    "program": Reader("O8700.nc", _program, _sent),
    "part.nc": Reader("part.nc", lambda f: PART.encode(), _followed),
    "facets.stl": Reader(
        "facets.stl",
        lambda f: re.sub(r"\b(10|12|3\.5)\b", r"\g<1>0", STL).replace("3.50", "35").encode(),
        lambda f: of_hull(mesh(f / "facets.stl"), (0.0, 0.0, 1.0)),
    ),
    "plate.obj": Reader("plate.obj", _text("plate.obj"), lambda f: read_hull(f / "plate.obj")),
    "plate.ply": Reader("plate.ply", lambda f: PLY.encode(), lambda f: read_hull(f / "plate.ply")),
    "plate.stl": Reader("plate.stl", lambda f: STL.encode(), lambda f: read_hull(f / "plate.stl")),
    **SHOP,
    **DATABASES,
    **TABLES,
    **BROUGHT,
    **BESIDES,
}
