"""A preset as a person names it: by its name, or by a file of one's own."""

from __future__ import annotations

from pathlib import Path

from kinespace.stream.feeds import Preset, builtin_names, builtin_preset, load_preset
from kinespace.tools.cli.choice import one_of

#: The ending of a user's own preset.
_ENDING = ".toml"


def preset_named(text: str) -> Preset:
    """Load a preset by its name, or from a user's file, which ends in .toml.

    Raises
    ------
    ValueError
        There is none of that name, or something in the file is wrong; the message begins with `--feed` or the file.
    OSError
        The file cannot be read.
    """
    if text.casefold().endswith(_ENDING):
        return load_preset(Path(text))
    return builtin_preset(one_of("--feed", text, builtin_names(), f" or a {_ENDING} file"))
