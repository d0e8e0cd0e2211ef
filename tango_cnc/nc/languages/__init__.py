"""One file a language of NC programs."""
