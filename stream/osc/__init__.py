"""OSC over UDP: packets, frames and answers as bytes, and the two endpoints.

`packet`, `frames` and `answers` know neither sockets nor clocks; `udp` holds the two endpoints.
"""

from kinespace.stream.osc.answers import (
    MAX_ANSWER,
    address_part,
    decode_answer,
    encode_classes,
    encode_event,
    encode_gone,
    encode_progress,
    encode_recognition,
    encode_status,
)
from kinespace.stream.osc.frames import MAX_FRAMES, SKELETON, Received, decode, encode_announcement, encode_frame
from kinespace.stream.osc.packet import Message, PacketError, decode_packet, encode_bundle, encode_message
from kinespace.stream.osc.udp import OscReceiver, OscSender, is_ours
