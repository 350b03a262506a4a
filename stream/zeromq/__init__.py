"""ZeroMQ: frames and answers as messages, and the two endpoints; `messages` knows neither sockets nor clocks."""

from kinespace.stream.zeromq.keys import Keyring
from kinespace.stream.zeromq.messages import decode, decode_answer, encode_frame, encode_recognition
from kinespace.stream.zeromq.sockets import MAX_MESSAGE, Endpoint, ZmqReceiver, ZmqSender
