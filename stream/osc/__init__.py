"""OSC over UDP: packets, frames and answers as bytes, and the two endpoints, `udp`; the others know no socket."""

from kinespace.stream.osc.messages import address_part, decode, decode_answer, encode_announcement, encode_frame
from kinespace.stream.osc.packet import decode_packet, encode_message
from kinespace.stream.osc.udp import OscReceiver, OscSender, is_ours
