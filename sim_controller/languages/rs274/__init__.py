"""RS-274/NGC with O words, as LinuxCNC executes it."""

from .control import Control, Profile, default_profile

__all__ = ["Control", "Profile", "default_profile"]
