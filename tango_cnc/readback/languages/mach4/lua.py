"""Scripts of Mach4 in Lua, which write or look, and move nothing: each has to be, line by line, one of those below."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from ....records import InputError

BEGINS = r"""function m{code}()
    local inst = mc.mcGetInstance()
    local function stop(why){off}
        mc.mcCntlMacroAlarm(inst, {code}, "TANGO " .. why)
    end
    local function value(number) return (mc.mcCntlGetPoundVar(inst, number)) end
    if value({number}) ~= {script_set} then stop("SCRIPTS ARE NOT THOSE OF THIS PROGRAM") return end"""
WRITES = r"""    local program = (mc.mcCntlGetGcodeFileName(inst))
    local file = (program:match("^(.*[/\\])") or "") .. "{file}"
    local function say(line)
        local f = io.open(file, "a")
        if f == nil then stop("CANNOT WRITE " .. file) return end
        f:write(line, "\n")
        f:close()
    end"""
LOOKS = r"""    local function text()
        local f = io.open(program, "r")
        local all = f and f:read("*a") or ""
        if f then f:close() end
        return all
    end
    local mark = text():match("TANGO {word} %x+ %d+")
    if mark then say(mark) else stop("NO {word} MARK IN THE PROGRAM") end"""
FREE = """    local signal = (mc.mcSignalGetHandle(inst, mc.ISIG_PROBE))
    if (mc.mcSignalGetState(signal)) ~= 0 then stop("PROBE IS DEFLECTED") end"""
RECORD = re.compile(
    r'    say\(string\.format\("P%\.0f H%\.0f((?: [A-Z]%\.4f)+)", value\((\d+)\), value\((\d+)\)((?:, value\(\d+\))+)\)\)'
)
BODIES = {
    880: (BEGINS, WRITES, LOOKS.replace("{word}", "START")),
    881: (BEGINS, WRITES),
    882: (BEGINS, WRITES, LOOKS.replace("{word}", "END")),
    883: (BEGINS,),
    884: (BEGINS, FREE),
}


OFF = """
        mc.mcCntlGcodeExecuteWait(inst, "{word}")"""


def record(
    companions: Mapping[str, Sequence[str]], file: str, number: int, script_set: int, off: str
) -> tuple[str, str, dict[str, str]]:
    """scripts, file of the records, variable and number of their set, word that switches the probe off (or none) → variables of
    touch and flag, {letter: variable}. The word has to stand before each alarm.

    Raises InputError naming the line that is none of theirs, or the script that is missing.
    """
    found = None
    for code, parts in BODIES.items():
        name = f"m{code}.mcs"
        if name not in companions:
            raise InputError(f"{name} is not among the scripts")
        stated = {"{off}": off and OFF.replace("{word}", off)}
        stated |= {"{code}": str(code), "{number}": str(number), "{script_set}": str(script_set), "{file}": file}
        text = "\n".join(parts)
        for word, value in stated.items():
            text = text.replace(word, value)
        comment, *lines = companions[name]
        if not comment.startswith("-- "):
            raise InputError(f"{name}: found {comment[:60]!r}; allowed: a remark in the first line")
        wanted = [*text.split("\n"), "end"]
        if code == 881:
            found = RECORD.fullmatch(lines[-2]) if len(lines) > 1 else None
            wanted[-1:] = [lines[-2], "end"] if found else ["a line that writes the record", "end"]
        for line, other in zip([*lines, *[""] * len(wanted)], [*wanted, *[""] * len(lines)], strict=False):
            if line != other:
                raise InputError(f"{name}: found {line[:80]!r}; allowed: {other[:80]!r}")
    assert found is not None
    letters, variables = re.findall(r"[A-Z](?=%)", found[1]), re.findall(r"\d+", found[4])
    if len(letters) != len(variables) or len({*letters}) != len(letters):
        raise InputError("m881.mcs: the record has another number of values than of letters, or a letter twice")
    return f"#{found[2]}", f"#{found[3]}", {name: f"#{variable}" for name, variable in zip(letters, variables, strict=True)}
