"""Steps of the schema in their order; a step that has been released is never edited."""
