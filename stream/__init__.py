"""A motion in flight: frames, the sliding window, the recogniser, its answers, and the transports around it."""

from kinespace.library.windows.rejection import Evidence
from kinespace.stream.frame import Announcement, Frame
from kinespace.stream.recognition import Done, Event, EventKind, Outcome, Progress, Recognition
from kinespace.stream.recognizer import LiveSignature, MotionClassifier, Performers, Recognizer, Settings, recognise
from kinespace.stream.service.background import BackgroundViews

__all__ = [
    "Announcement",
    "BackgroundViews",
    "Done",
    "Event",
    "EventKind",
    "Evidence",
    "Frame",
    "LiveSignature",
    "MotionClassifier",
    "Outcome",
    "Performers",
    "Progress",
    "Recognition",
    "Recognizer",
    "Settings",
    "recognise",
]
