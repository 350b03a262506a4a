"""What every reader raises for a file that cannot be used."""

from __future__ import annotations


class RecordingError(ValueError):
    """A recording cannot be found or used; the message names it and, where there is one, the line or byte."""
