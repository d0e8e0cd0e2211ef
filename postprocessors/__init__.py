"""Plan → NC program, one file per dialect; the file name is the name of the post."""
