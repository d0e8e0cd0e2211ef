"""SINUMERIK programs, as a control executes them."""

from .axes import SPOKEN
from .control import Control, Profile, default_profile

__all__ = ["SPOKEN", "Control", "Profile", "default_profile"]
