"""One file a page: each has `ROUTES`, and appears in the server by being there."""
