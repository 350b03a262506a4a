"""A motion in flight: frames, the sliding window, the recogniser, its answers, and the transports around it."""

from stream.frame import Announcement, Frame
from stream.performers import Performers
from stream.recognition import Outcome, Recognition
from stream.recognizer import LiveSignature, Recognizer, Settings

__all__ = ["Announcement", "Frame", "LiveSignature", "Outcome", "Performers", "Recognition", "Recognizer", "Settings"]
