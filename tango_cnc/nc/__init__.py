"""NC programs: read block by block, compensated, foretold (docs/compensate.md)."""
