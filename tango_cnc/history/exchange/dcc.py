"""A Digital Calibration Certificate of one night (PTB, schema 3.2.1 with D-SI 2.1.0): every parameter and its expanded uncertainty.

It is a statement of the owner of the machine about the machine and no certificate of an accredited laboratory, and says so.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from datetime import datetime
from pathlib import Path
from typing import Any

from ... import __version__
from ...files import write_text
from ...records import InputError
from ...texts import say
from ..store import History

ENDINGS = (".xml",)
DCC, SI, XSI = "https://ptb.de/dcc", "https://ptb.de/si", "http://www.w3.org/2001/XMLSchema-instance"
VERSION = "3.2.1"
COVERAGE = 2.0
UNITS = {"mm": (1e-3, r"\metre"), "rad": (1.0, r"\radian"), "mm/mm": (1.0, r"\one")}


def write(history: History, machine: str, file: Path, entry: int) -> None:
    """history, machine, file, entry of a night → written. Raises InputError for a night without parameters."""
    stored = history.night(entry)
    if not stored.record.get("parameters"):
        raise InputError(f"night {stored.night.night}: no parameters were measured; allowed: a night with a complete measurement")
    ET.register_namespace("dcc", DCC)
    ET.register_namespace("si", SI)
    ET.register_namespace("xsi", XSI)
    text = ET.tostring(certificate(machine, entry, stored.record), encoding="unicode", xml_declaration=False)
    write_text(file, f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n')


def certificate(machine: str, entry: int, record: Any) -> ET.Element:
    """machine, entry, tango-night/1 → root of the document."""
    where = f"{DCC} {DCC}/v{VERSION}/dcc.xsd"
    root = ET.Element(f"{{{DCC}}}digitalCalibrationCertificate", {"schemaVersion": VERSION, f"{{{XSI}}}schemaLocation": where})
    admin = _sub(root, "administrativeData")
    software = _sub(_sub(admin, "dccSoftware"), "software")
    _content(_sub(software, "name"), "tango_cnc")
    _sub(software, "release").text = __version__
    core = _sub(admin, "coreData")
    _sub(core, "countryCodeISO3166_1").text = "ZZ"
    _sub(core, "usedLangCodeISO639_1").text = "en"
    _sub(core, "mandatoryLangCodeISO639_1").text = "en"
    _sub(core, "uniqueIdentifier").text = f"tango-{'simulated-' if record.get('simulated') else ''}{record['night']}-{entry}"
    _sub(core, "beginPerformanceDate").text = _date(record["start_utc"])
    _sub(core, "endPerformanceDate").text = _date(record["end_utc"])
    _sub(core, "performanceLocation").text = "customer"
    items = _sub(admin, "items")
    item = _sub(items, "item")
    _content(_sub(item, "name"), f"{machine} (simulated)" if record.get("simulated") else machine)
    identification = _sub(_sub(item, "identifications"), "identification")
    _sub(identification, "issuer").text = "owner"
    _sub(identification, "value").text = machine
    laboratory = _sub(admin, "calibrationLaboratory")
    _contact(laboratory, "owner of the machine; not an accredited laboratory")
    persons = _sub(admin, "respPersons")
    person = _sub(_sub(persons, "respPerson"), "person")
    _content(_sub(person, "name"), str(record.get("owner") or "not stated"))
    customer = _sub(admin, "customer")
    _content(_sub(customer, "name"), "owner of the machine")
    _location(customer)
    _statements(admin, record)
    results = _sub(_sub(root, "measurementResults"), "measurementResult")
    _content(_sub(results, "name"), "Geometric errors of the machine")
    method = _sub(_sub(results, "usedMethods"), "usedMethod")
    _content(_sub(method, "name"), "touches of the machine's own probe on its own table at many rotary indexations (TANGO)")
    values = _sub(results, "results")
    for name, p in record["parameters"].items():
        factor, unit = UNITS.get(p["unit"], (1.0, r"\one"))
        result = _sub(values, "result")
        _content(_sub(result, "name"), f"{name}, {p['unit']}" if p["unit"] not in UNITS else name)
        quantity = _sub(_sub(result, "data"), "quantity")
        real = ET.SubElement(quantity, f"{{{SI}}}real")
        ET.SubElement(real, f"{{{SI}}}value").text = repr(p["value"] * factor)
        ET.SubElement(real, f"{{{SI}}}unit").text = unit
        expanded = ET.SubElement(real, f"{{{SI}}}expandedUnc")
        ET.SubElement(expanded, f"{{{SI}}}uncertainty").text = repr(COVERAGE * p["std"] * factor)
        ET.SubElement(expanded, f"{{{SI}}}coverageFactor").text = repr(COVERAGE)
        ET.SubElement(expanded, f"{{{SI}}}coverageProbability").text = "0.95"
        ET.SubElement(expanded, f"{{{SI}}}distribution").text = "normal"
    return root


def _statements(admin: ET.Element, record: Any) -> None:
    declaration = _sub(_sub(_sub(admin, "statements"), "statement"), "declaration")
    said = f"{record['headline']}. Standard deviations state scatter, not what repeats in every touch."
    _content(declaration, f"{say('audit.simulated')}. {said}" if record.get("simulated") else said)


def _contact(parent: ET.Element, name: str) -> None:
    contact = _sub(parent, "contact")
    _content(_sub(contact, "name"), name)
    _location(contact)


def _location(parent: ET.Element) -> None:
    _sub(_sub(parent, "location"), "further")
    _content(parent[-1][0], "not stated")


def _sub(parent: ET.Element, name: str) -> ET.Element:
    return ET.SubElement(parent, f"{{{DCC}}}{name}")


def _content(parent: ET.Element, text: str) -> None:
    _sub(parent, "content").text = text
    parent[-1].set("lang", "en")


def _date(stamp: str) -> str:
    return datetime.fromisoformat(stamp).strftime("%Y-%m-%d")
