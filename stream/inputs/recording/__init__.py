"""Raw recordings: their file, the recorder that writes it while a feed is received, and playback."""

from kinespace.stream.inputs.recording.kinerec import ENDING, RawFile, RawFileError, RawHeader, RawPacket, RawWriter
from kinespace.stream.inputs.recording.playback import Decoded, decoded
from kinespace.stream.inputs.recording.recorder import Recorder, source_name
