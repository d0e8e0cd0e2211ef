"""What the model may contain, one family per file; the file name is the name of the family."""
