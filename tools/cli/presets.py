"""Presets and sets of joints as people name them."""

from __future__ import annotations

from pathlib import Path

from kinespace.library.naming import spelling
from kinespace.library.recordings.formats import utkinect
from kinespace.stream.feeds import Preset, builtin_names, builtin_preset, load_preset
from kinespace.tools.cli.values import one_of

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


#: Joint sets that no preset has: the joints of Kinect 1's own tools.
_FURTHER = {"kinect20": tuple(name for name in utkinect.SKELETON.joints if name != "Spine")}
#: The names that conventions of joint names have for the sensors.
_ALSO = {"kinect1": "kinect20", "kinect2": "kinectv2"}


def joints_in_order(text: str) -> tuple[str, ...]:
    """Read the joints of a sender's frames, in order, from an option's text.

    Parameters
    ----------
    text
        Names with commas between; or a preset with an `order`, by its name or a file ending in .toml.

    Returns
    -------
    The motion library's names, and the sender's own names for joints that the library lacks.

    Raises
    ------
    ValueError
        A preset has no order, because its messages name their joints; or a name is empty or appears twice.
    OSError
        The file cannot be read.
    """
    if "," in text:
        joints = tuple(name.strip() for name in text.split(","))
    else:
        ordered = [each for each in builtin_names() if builtin_preset(each).order]
        if text not in builtin_names() and not text.endswith(".toml"):
            one_of("--joints", text, ordered, ", a .toml file or names with commas between")
        preset = preset_named(text)
        if not preset.order:
            raise ValueError(
                f"--joints: expected a preset with an order of joints ({', '.join(ordered)}), got {text}, whose "
                "messages name them"
            )
        ours = {spelling(name): target for name, target in preset.joint_map.items()}
        joints = tuple(ours.get(spelling(name)) or name for name in preset.order)
    if not all(joints) or len(set(joints)) != len(joints):
        raise ValueError(f"--joints: expected distinct names with commas between, got {text!r}")
    return joints


def joints_of(name: str) -> tuple[str, ...]:
    """Give the joints of a set, in HDM05's names.

    Raises
    ------
    ValueError
        There is no such set.
    """
    one_of("--skeleton", name, sorted((*builtin_names(), *_FURTHER, *_ALSO)))
    name = _ALSO.get(name, name)
    return _FURTHER[name] if name in _FURTHER else builtin_preset(name).joints
