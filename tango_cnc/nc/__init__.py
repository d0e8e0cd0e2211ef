"""NC programs: read block by block, compensated, predicted (docs/compensate.md)."""
