"""A HAL component of LinuxCNC (its python, its `hal`): the pipe between the pins and `contact.py`, which knows the table.

Out: time in s, X Y Z in mm, B C S in deg (A C S of a machine with a cradle A), whether the probe is on or was since. In: nothing,
or a plane: slopes per mm and deg, and its offset.
The HAL module belongs to the system's python, the simulated machine to the project's; they need not be of one version.
"""

import subprocess
import sys
import time

import hal

AHEAD = 6  # periods that may begin before the next look: as many as an idle computer has between two of them
GAINS = ("plane.xy.gain0", "plane.xy.gain1", "plane.zb.gain0", "plane.zb.gain1", "plane.gap.gain1", "plane.xy.offset")

component = hal.component("table")
for name in "XYZBCS":
    component.newpin(name, hal.HAL_FLOAT, hal.HAL_IN)
component.newpin("echo", hal.HAL_FLOAT, hal.HAL_IN)
component.newpin("serial", hal.HAL_FLOAT, hal.HAL_OUT)
component.newpin("begun", hal.HAL_S32, hal.HAL_IN)
component.newpin("until", hal.HAL_S32, hal.HAL_OUT)
for name in ("probe", "was"):
    component.newpin(name, hal.HAL_BIT, hal.HAL_IN)
for name in ("arm", "disarm", "forget", "alive"):
    component.newpin(name, hal.HAL_BIT, hal.HAL_OUT)
component.ready()


def position():
    """→ X Y Z B C S of one and the same period: read until nothing has changed in between."""
    while True:
        values = [component[name] for name in "XYZBCS"]
        if values == [component[name] for name in "XYZBCS"]:
            return values


def go_on(count):
    """Lets so many further periods begin; where lockstep.comp is not installed they do so anyway."""
    component["until"] = component["begun"] + count


def periods(count):
    """Waits: the echo is the last thing in a period."""
    for _ in range(count):
        component["serial"] += 1.0
        go_on(2)  # one may be half over
        while component["echo"] != component["serial"]:
            time.sleep(0.0002)


with open("contact.err", "w", encoding="utf-8") as err:
    judge = subprocess.Popen(
        ["@PYTHON@", "@CONTACT@", "."], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=err, text=True, bufsize=1
    )
    while judge.poll() is None:
        values = position()
        was, on = component["was"], component["probe"]  # after the position: a contact before that must not be missed
        judge.stdin.write(" ".join(map(repr, (time.monotonic(), *values, int(was or on)))) + "\n")
        component["forget"] = was and not on  # a contact may be over before anybody here has looked
        answer = judge.stdout.readline().split()
        if answer:
            component["disarm"] = component["forget"] = True  # no plane is half the old and half the new one
            periods(2)
            for gain, value in zip(GAINS, answer, strict=True):
                hal.set_p(gain, value)
            periods(2)  # one of them whole, with the new plane
            component["disarm"] = component["forget"] = False
            component["arm"] = True
            periods(2)
            component["arm"] = False
        component["alive"] = not component["alive"]
        go_on(AHEAD)
        if not answer:
            time.sleep(0.004)
component["until"] = 0
sys.exit("contact.py has ended")
