"""SINUMERIK programs, as a control executes them."""

from .axes import CONTROLS
from .control import Control, Profile, default_profile

__all__ = ["CONTROLS", "Control", "Profile", "default_profile"]
