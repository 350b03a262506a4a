"""Sets of joints by name: the library's joints that a product's feed has."""

from __future__ import annotations

from kinespace.library.naming import spelling
from kinespace.library.recordings.formats import utkinect
from kinespace.stream.feeds import builtin_names, builtin_preset
from kinespace.tools.cli.choice import one_of
from kinespace.tools.cli.preset import preset_named

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
