"""Sets of joints by name: which of the library's joints a product's feed has."""

from __future__ import annotations

from stream.feeds import builtin_names, builtin_preset

#: Bodies without a feed of their own: what Kinect 1's own tools track.
_FURTHER = {
    "kinect20": (
        *("root", "upperback", "lowerneck", "head"),
        *("lclavicle", "lhumerus", "lradius", "lhand", "rclavicle", "rhumerus", "rradius", "rhand"),
        *("lhipjoint", "lfemur", "ltibia", "ltoes", "rhipjoint", "rfemur", "rtibia", "rtoes"),
    )
}


def names() -> tuple[str, ...]:
    """Names of all sets."""
    return (*builtin_names(), *_FURTHER)


def joints_of(name: str) -> tuple[str, ...]:
    """Give the joints of a set, in HDM05's names.

    Raises
    ------
    ValueError
        There is no such set.
    """
    if name not in names():
        raise ValueError(f"--skeleton: expected one of {', '.join(names())}, got {name!r}")
    return _FURTHER[name] if name in _FURTHER else builtin_preset(name).joints
