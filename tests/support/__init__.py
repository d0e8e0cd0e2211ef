"""What several tests stand on: cells, controls, faults, judges. No test imports a test."""
