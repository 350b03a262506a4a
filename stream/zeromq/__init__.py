"""ZeroMQ: frames and answers as messages, and the two endpoints.

`frames`, `single_part` and `answers` know neither sockets nor clocks; `address`, `keys`, `reconnection` and `sockets`
are the endpoints.
"""

from kinespace.stream.zeromq.address import MAX_MESSAGE, Endpoint
from kinespace.stream.zeromq.answers import (
    decode_answer,
    encode_classes,
    encode_event,
    encode_gone,
    encode_recognition,
    encode_status,
)
from kinespace.stream.zeromq.frames import MAX_HEADER, FormatError, NumberedFrame, SequenceGaps, decode, encode_frame
from kinespace.stream.zeromq.keys import Keyring
from kinespace.stream.zeromq.sockets import MAX_PARTS, ZmqReceiver, ZmqSender

__all__ = [
    "MAX_HEADER",
    "MAX_MESSAGE",
    "MAX_PARTS",
    "Endpoint",
    "FormatError",
    "Keyring",
    "NumberedFrame",
    "SequenceGaps",
    "ZmqReceiver",
    "ZmqSender",
    "decode",
    "decode_answer",
    "encode_classes",
    "encode_event",
    "encode_frame",
    "encode_gone",
    "encode_recognition",
    "encode_status",
]
