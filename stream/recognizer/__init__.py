"""The recogniser: frames go in with their time, recognitions come out. No socket, clock, thread or print in here."""

from kinespace.stream.recognizer.classifier import MotionClassifier, recognise
from kinespace.stream.recognizer.performers import Performers, SentJoints
from kinespace.stream.recognizer.recognizer import Recognizer
from kinespace.stream.recognizer.settings import LiveSignature, Settings
