"""The way in: receivers of packets, decoders of packets, and sources, which are a receiver and a decoder."""

from kinespace.stream.inputs.admission import Admission
from kinespace.stream.inputs.decoder import OwnDecoder
from kinespace.stream.inputs.source import FeedSource, Receiver, Source
