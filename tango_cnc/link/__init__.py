"""Plan and program → readings: the only part that talks to a controller."""
