"""Feeds of other products: presets that say what their messages mean, and what makes frames of them."""

from stream.feeds.assembler import FrameAssembler
from stream.feeds.mapper import Mapper
from stream.feeds.preset import Preset, PresetError, builtin_names, builtin_preset, load_preset

__all__ = ["FrameAssembler", "Mapper", "Preset", "PresetError", "builtin_names", "builtin_preset", "load_preset"]
