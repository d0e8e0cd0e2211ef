"""The lines of grbl 1.1, grblHAL and FluidNC, as these firmwares execute them."""

from .control import REALTIME, RESET, SPOKEN, Control, Profile, default_profile, switched_on

__all__ = ["REALTIME", "RESET", "SPOKEN", "Control", "Profile", "default_profile", "switched_on"]
