"""What several languages have in common: alarms, scales of axes, expressions in square brackets."""
