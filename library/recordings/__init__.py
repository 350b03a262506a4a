"""Recorded files: found, read in any format, and turned into clips."""

from kinespace.library.recordings.formats.errors import RecordingError
from kinespace.library.recordings.reader import (
    FILMS,
    ActorIn,
    Reading,
    RecordingReader,
    clips_of,
    find_recordings,
    instead_of_recording,
    is_recording,
    is_systems,
    labelled,
    performed,
    read_recordings,
    segments_beside,
)
