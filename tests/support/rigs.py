"""What a move meets on a simulated machine is not looked for again: hundreds of tests let the same programs move on the same one.
Nor is a run simulated again: half of all simulated nights are quiet ones that another test of the same file had, too.

Whoever tests the simulated machine itself (`test_sim_motion.py` and the others of `ANEW`) has it look every time.
"""

from __future__ import annotations

import pickle
from collections import OrderedDict
from hashlib import sha256
from importlib import import_module
from inspect import signature
from typing import Any

import pytest

from sim_controller import probing
from sim_controller.motion import Motion
from sim_controller.probing import Rig
from tango_cnc.records import Array, Artefact, Machine, Strategy, World

KEPT = 40  # rigs
MOVES = 4000  # of one rig
ANEW = ("test_sim_motion", "test_sim_shank", "test_sim_world", "test_sim_effects", "test_sim_simulate", "test_kinematics")
MADE: OrderedDict[tuple[Any, ...], tuple[Rig, Machine, Artefact]] = OrderedDict()
CYCLES: OrderedDict[tuple[int, int, int], tuple[Any, Any]] = OrderedDict()
RUNS: OrderedDict[bytes, bytes] = OrderedDict()  # digest of all that a run depends on → its readings
READ = 400  # runs, some 50 kB each
MET: dict[int, dict[tuple[bytes | float, ...], Any]] = {}  # of the rigs in MADE, by `id`
_rig, _meets = probing.rig, Motion._meets
anew = False  # whether the test that is executed wants everything looked for


def _remembered(
    machine: Machine, artefact: Artefact, world: World, seed: int | None = None, *more: Any, control: Any = None, **other: Any
) -> Rig:
    """As `probing.rig`; the same for the same machine, artefact and world. It is frozen: nobody can change what is true in it."""
    if anew or more or other or control is not None:
        return _rig(machine, artefact, world, seed, *more, control=control, **other)
    key = id(machine), id(artefact), pickle.dumps((world, seed))  # what `id` names is kept beside the rig
    if key not in MADE:
        made = _rig(machine, artefact, world, seed)
        MADE[key] = made, machine, artefact
        MET[id(made)] = {}
    MADE.move_to_end(key)
    while len(MADE) > KEPT:
        _, (gone, *_) = MADE.popitem(last=False)
        MET.pop(id(gone))
    return MADE[key][0]


def _known(motion: Motion, end: Array, direction: Array, after: float) -> Any:
    """As `Motion._meets`, which depends on the rig and on the move alone."""
    met = None if anew else MET.get(id(motion.rig))
    if met is None:
        return _meets(motion, end, direction, after)
    move = motion._position.tobytes(), end.tobytes(), direction.tobytes(), after
    if move not in met:
        if len(met) >= MOVES:
            met.clear()
        met[move] = _meets(motion, end, direction, after)
    return met[move]


def _planned(machine: Machine, artefact: Artefact, strategy: Strategy) -> Any:
    """As `simulate._commanded`, which no world changes."""
    if anew:
        return _commanded(machine, artefact, strategy)
    key = id(machine), id(artefact), id(strategy)
    if key not in CYCLES:
        CYCLES[key] = _commanded(machine, artefact, strategy), (machine, artefact, strategy)
    CYCLES.move_to_end(key)
    while len(CYCLES) > KEPT:
        CYCLES.popitem(last=False)
    return CYCLES[key][0]


def _run(*asked: Any, **more: Any) -> Any:
    """As `simulate`, which depends on its arguments alone. Everybody has readings of his own, which he may change."""
    given = _arguments.bind(*asked, **more)
    spied = _simulated.effects.disturbance is not _disturbance  # by a test that wants to see what the machine does
    if anew or spied or given.arguments.get("control") is not None:  # what a control does is a function
        return _simulate(*asked, **more)
    key = sha256(pickle.dumps(sorted(given.arguments.items()))).digest()
    if key not in RUNS:
        RUNS[key] = pickle.dumps(_simulate(*asked, **more))
    RUNS.move_to_end(key)
    while len(RUNS) > READ:
        RUNS.popitem(last=False)
    return pickle.loads(RUNS[key])


probing.rig, Motion._meets = _remembered, _known  # type: ignore[method-assign]
# Read after that, so that it has the rigs from here, too.
_simulated = import_module("sim_controller.simulate")
_commanded, _simulated._commanded = _simulated._commanded, _planned  # type: ignore[attr-defined]
_simulate, _simulated.simulate = _simulated.simulate, _run  # type: ignore[attr-defined]
_arguments, _disturbance = signature(_simulate), _simulated.effects.disturbance


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Before any fixture of the test, those of its module too."""
    global anew
    anew = item.path.name.startswith(ANEW)
