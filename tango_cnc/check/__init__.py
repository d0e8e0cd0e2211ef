"""What a plan must not do: leave the travels, reach through the table, touch what it does not measure."""

from .collision import Pose, obstruction
from .solid import Solid, body_of, solid
from .travel import outside

__all__ = ["Pose", "Solid", "body_of", "obstruction", "outside", "solid"]
