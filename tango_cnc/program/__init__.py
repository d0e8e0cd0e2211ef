"""Plan → written programs: post, then read back, then compare with what the folder of programs already holds."""

from .folder import REST, stale
from .parts import parts
from .record import Program, beside_of
from .write import from_file, programs, proven

__all__ = ["REST", "Program", "beside_of", "from_file", "parts", "programs", "proven", "stale"]
