"""A motion in flight: frames, the sliding window, the recogniser, its answers, and the transports around it."""

from kinespace.stream.frame import Announcement, Frame
from kinespace.stream.recognition import Outcome, Recognition
from kinespace.stream.recognizer import LiveSignature, Performers, Recognizer, Settings

__all__ = ["Announcement", "Frame", "LiveSignature", "Outcome", "Performers", "Recognition", "Recognizer", "Settings"]
