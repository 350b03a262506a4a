"""OSC over UDP: packets, frames and answers as bytes, and the two endpoints.

`packet`, `frames` and `answers` know neither sockets nor clocks; `udp` holds the two endpoints.
"""

from kinespace.stream.osc.answers import address_part, decode_answer, encode_recognition
from kinespace.stream.osc.frames import MAX_FRAMES, SKELETON, Received, decode, encode_announcement, encode_frame
from kinespace.stream.osc.packet import decode_packet, encode_message
from kinespace.stream.osc.udp import OscReceiver, OscSender, is_ours
