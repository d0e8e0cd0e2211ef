"""A HAL component of LinuxCNC (its python, its `hal`): the table of a wCBXfZY machine, and a probe that trips on it.

table.json: {"length": mm, "radius": mm, "facets": [[point, normal], …], "balls": [[centre, radius], …]}
"""

import json
import math
import time

import hal

with open("table.json", encoding="utf-8") as file:
    TABLE = json.load(file)

component = hal.component("table")
for name in "XYZBC":
    component.newpin(name, hal.HAL_FLOAT, hal.HAL_IN)
component.newpin("probe", hal.HAL_BIT, hal.HAL_OUT)
component.ready()


def touching(x, y, z, b, c):
    """Axis positions → whether the ball is in contact: patches of 15 mm around the facets' points, and whole balls."""
    p = [-x, y, z - TABLE["length"]]
    p[0], p[2] = math.cos(b) * p[0] - math.sin(b) * p[2], math.sin(b) * p[0] + math.cos(b) * p[2]
    p[0], p[1] = math.cos(c) * p[0] + math.sin(c) * p[1], -math.sin(c) * p[0] + math.cos(c) * p[1]
    for point, normal in TABLE["facets"]:
        way = [i - j for i, j in zip(p, point, strict=True)]
        gap = sum(i * j for i, j in zip(way, normal, strict=True))
        aside = math.sqrt(max(sum(i * i for i in way) - gap * gap, 0.0))
        if -6.0 < gap <= TABLE["radius"] and aside < 15.0:
            return True
    return any(math.dist(p, centre) <= size + TABLE["radius"] for centre, size in TABLE["balls"])


while True:
    at = [component[name] for name in "XYZBC"]
    component["probe"] = touching(*at[:3], math.radians(at[3]), math.radians(at[4]))
    time.sleep(0.0003)
