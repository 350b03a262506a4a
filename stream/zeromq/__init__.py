"""ZeroMQ: frames and answers as messages, and the two endpoints.

`frames`, `bodies` and `answers` know neither sockets nor clocks; the others are the endpoints.
"""

from kinespace.stream.zeromq.answers import decode_answer, encode_recognition
from kinespace.stream.zeromq.frames import MAX_HEADER, FormatError, SequenceGaps, decode, encode_frame
from kinespace.stream.zeromq.keys import Keyring
from kinespace.stream.zeromq.sockets import MAX_MESSAGE, Endpoint, ZmqReceiver, ZmqSender
