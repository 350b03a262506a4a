"""What comes in: receivers of packets, decoders of what they hold, and sources, which are a receiver and a decoder."""

from kinespace.stream.inputs.decoder import Decoder, OscDecoder, ZmqDecoder
from kinespace.stream.inputs.receiver import Packet, Receiver, Sender
from kinespace.stream.inputs.source import Source

__all__ = ["Decoder", "OscDecoder", "Packet", "Receiver", "Sender", "Source", "ZmqDecoder"]
