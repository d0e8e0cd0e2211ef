"""Mach4: its macro programming is Fanuc's, its M codes from 100 on are Lua scripts, run here by Lua itself.

Facts: Mill GCode Programming, Scripting Manual and Mach4CoreAPI of ArtSoft. #5021 #5041 #5061 count X Y Z A B C whatever the
machine has; G31 that meets nothing stores its target and says nothing; a script mNNN.mcs is carried out when the axes stand.
`library` is the Macros folder: the name of each file on a line of its own, then its text. What scripts write into a file goes
to `punch`; the only file that they can read is the program.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

from tango_cnc.records import InputError, Machine

from ..motion import Motion, Note
from . import macro_b
from ._shared.alarm import Alarm
from ._shared.known import ORIENT, Controls
from .macro_b.alarms import alarm
from .macro_b.blocks import Block, Word, block
from .macro_b.profile import Profile
from .macro_b.profile import default_profile as family_profile
from .macro_b.program import Program

__all__ = ["CONTROLS", "Control", "Profile", "default_profile"]

SIGNAL = 178  # some number
PROGRAM = "C:\\Mach4Hobby\\GcodeFiles\\program.nc"
SHIM = """
return function(mc_table, program_text, punch)
    mc = {}
    for name, call in pairs(mc_table) do mc[name] = call end
    io = {open = function(name, mode)
        if mode == "r" then
            if name ~= mc.program then return nil, "no such file" end
            return {read = function() return program_text end, close = function() end}
        end
        if mode ~= "a" and mode ~= "w" then error("mode " .. tostring(mode)) end
        return {write = function(self, ...) for _, text in ipairs({...}) do punch(tostring(text)) end return self end,
                close = function() end}
    end}
    os, require, dofile, loadfile, package, debug = nil, nil, nil, nil, nil, nil
end
"""


CONTROLS = Controls(shown_by={"orient": ORIENT}, beside=re.compile(r"m\d+\.mcs"))


def default_profile(machine: Machine) -> Profile:
    """machine → profile of the family; programs run from the disk of the PC."""
    return replace(family_profile(machine), memory=0, numbered="XYZABC")


class Control(macro_b.Control):
    """The control's memory from switching on to switching off; `library` is its Macros folder."""

    def __init__(
        self, motion: Motion, profile: Profile, punch: Callable[[bytes], None], note: Note, library: Iterable[str] = ()
    ) -> None:
        super().__init__(motion, profile, punch, note)
        self._scripts = _files(library)
        self._lua: Any = None
        self._stopped: Alarm | None = None

    def run(self, lines: Iterable[str], streamed: bool) -> None:
        """lines of a file → executed to M2 or M30. Raises Alarm where the control would stop, Silence without power."""
        whole = list(lines)
        self._lua = _lua(self._calls(), "\n".join(whole), lambda text: self._punch(text.encode("ascii")))
        for name, text in self._scripts.items():
            try:
                self._lua.execute(text)
            except self._lua.error as error:
                raise Alarm("LUA", f"{name} is no script", str(error)) from None
        super().run([line for line in whole if line.strip() != "%"], False)

    def _dwell(self, milliseconds: Word | None, seconds: Word | None) -> None:
        self._motion.dwell(milliseconds.value if milliseconds is not None else 0.0)  # P counts seconds here

    def _calls(self) -> dict[str, Any]:
        def stop(inst: int, code: float, text: str) -> int:
            self._stopped = Alarm(f"M{int(code)}", str(text))
            return 0

        def value(inst: int, number: float) -> float:
            return float(self._variables.get(int(number)) or 0.0)

        def executed(inst: int, text: str) -> int:
            found = block(str(text))
            self._nc(Program("MDI", [str(text)]), 0, found, 0)
            return 0

        return {
            "program": PROGRAM,
            "mcGetInstance": lambda *name: 0,
            "mcCntlGetGcodeFileName": lambda inst: PROGRAM,
            "mcCntlGetPoundVar": value,
            "mcCntlMacroAlarm": stop,
            "mcCntlGcodeExecuteWait": executed,
            "ISIG_PROBE": SIGNAL,
            "mcSignalGetHandle": lambda inst, signal: (signal, 0),
            "mcSignalGetState": lambda handle: (int(handle == SIGNAL and self._motion.deflected), 0),
            "mcCntlSetLastError": lambda inst, text: self._note("message", text=str(text)),
        }

    def _nc(self, program: Program, index: int, block: Block, depth: int) -> tuple[bool | None, int | None]:
        if match := re.fullmatch(r"M(\d{3,})", block.text):
            self._script(int(match[1]), block)
            return None, None
        if re.search(r"M\d{3}", block.text):
            raise Alarm("M", "a script shares its block with other words", block.raw)
        return super()._nc(program, index, block, depth)

    def _script(self, code: int, block: Block) -> None:
        self._axes.settle()
        if f"m{code}.mcs" not in self._scripts:
            raise Alarm("M", f"M{code} has no script", block.raw)
        self._note("m", code=code)
        try:
            self._lua.eval(f"m{code}")()
        except self._lua.error as error:
            raise Alarm("LUA", f"m{code}.mcs", str(error)) from None
        if self._stopped is not None:
            stopped, self._stopped = self._stopped, None
            raise stopped

    def _print(self, text: str, block: Block) -> None:
        raise alarm("PS0114", block.raw)


def _files(library: Iterable[str]) -> dict[str, str]:
    """lines, names of files on lines of their own → {name: text}."""
    found: dict[str, list[str]] = {}
    current: list[str] = []
    for line in library:
        if re.fullmatch(r"m\d+\.mcs", line.strip()):
            current = found.setdefault(line.strip(), [])
        else:
            current.append(line)
    return {name: "\n".join(text) for name, text in found.items()}


class _Lua:
    """A Lua that knows `mc` and one file."""

    def __init__(self, runtime: Any, error: type[Exception]) -> None:
        self.execute, self.eval, self.error = runtime.execute, runtime.eval, error


def _lua(calls: dict[str, Any], text: str, punch: Callable[[str], None]) -> _Lua:
    try:
        import lupa
    except ImportError:
        raise InputError("--language mach4: found no Lua; allowed: with it, pip install lupa") from None
    runtime = lupa.LuaRuntime(unpack_returned_tuples=True, register_eval=False, attribute_filter=_nothing)
    runtime.execute(SHIM)(runtime.table_from(calls), text, punch)
    return _Lua(runtime, lupa.LuaError)


def _nothing(obj: Any, name: Any, setting: bool) -> Any:
    raise AttributeError("scripts have no Python")
