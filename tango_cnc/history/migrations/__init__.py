"""Migrations of the schema, one file a step, run by Alembic when a history is opened."""
