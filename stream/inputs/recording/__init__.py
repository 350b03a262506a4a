"""Raw recordings: their file, the recorder that writes it while a feed is received, and the takes read from it."""

from kinespace.stream.inputs.recording.kinerec import ENDING, RawFile, RawFileError, RawWriter, Recorder, source_name
from kinespace.stream.inputs.recording.takes import decoded
