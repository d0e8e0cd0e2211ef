"""Results → text, pictures and HTML for people."""
