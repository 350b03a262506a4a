"""Strangers and faults against a running recogniser: `make chaos`."""
