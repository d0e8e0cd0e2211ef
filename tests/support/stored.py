"""What several tests share of random programs."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from postprocessors import companions
from support.dialects import EVERY
from support.randomplans import posts
from tango_cnc.records import Plan

NOTHING: Mapping[str, Any] = MappingProxyType({})  # is stated of a control


def stored(name: str, made: Plan, stated: Mapping[str, Any] = NOTHING) -> tuple[str, ...]:
    """dialect, plan, profile → what its control has in store: files that come with the program, else what it always has."""
    drive = "TNC:\\" if EVERY[name].family == "klartext" else ""
    files = companions(posts(name), made, stated)
    return tuple(line for file, lines in files.items() for line in (drive + file, *lines)) or EVERY[name].library
