"""Machine, artefact and goal → which touches are worth their time (docs/design.md)."""
