"""Pages for a browser: fleet, machine, night, run, trend and decisions; served from this computer (docs/serve.md)."""
