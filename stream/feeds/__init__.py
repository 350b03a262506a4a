"""Feeds of other products: presets that give the meaning of their messages, and decoders that make frames of them."""

from kinespace.stream.feeds.frame_assembler import FrameAssembler
from kinespace.stream.feeds.message_reader import Mapper
from kinespace.stream.feeds.preset import Preset, PresetError, builtin_names, builtin_preset, load_preset, parse_preset
