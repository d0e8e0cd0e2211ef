"""Fanuc custom macro B and its relatives, as a control executes it."""

from .control import Control, Profile, default_profile
from .profile import CONTROLS

__all__ = ["CONTROLS", "Control", "Profile", "default_profile"]
