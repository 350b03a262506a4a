"""Taught gestures on long takes and shows: when they are said, and when they should not have been."""
