"""A process that pretends to be the controller, and the true machine behind it."""
