"""What several tests share of compensate closing."""

from __future__ import annotations

EXAMPLES = ("hu40t", "huron", "fork_head", "split", "trunnion", "three_axis_calibrated")
SETTINGS = {"value_sheet": ("increment=0.0001", "points=17")}
