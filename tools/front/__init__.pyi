# For type checkers: the names that `kinespace` imports when they are asked for.
from kinespace import library as library
from kinespace import stream as stream
from kinespace.library import Clip as Clip
from kinespace.library import MotionLibrary as MotionLibrary
from kinespace.library import Skeleton as Skeleton
from kinespace.library import clips_of as clips_of
from kinespace.library import distance_rows as distance_rows
from kinespace.library import opened as opened
from kinespace.library import read_recordings as read_recordings
from kinespace.stream import Announcement as Announcement
from kinespace.stream import Frame as Frame
from kinespace.stream import MotionClassifier as MotionClassifier
from kinespace.stream import Performers as Performers
from kinespace.stream import Recognition as Recognition
from kinespace.stream import Recognizer as Recognizer
from kinespace.stream import Settings as Settings
from kinespace.stream import recognise as recognise

__version__: str
