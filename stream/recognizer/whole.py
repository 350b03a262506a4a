"""A whole clip pushed through the recogniser that runs live, at full speed."""

from __future__ import annotations

from kinespace.library.clip import Clip
from kinespace.library.motion_library import MotionLibrary
from kinespace.stream.frame import MAX_PERFORMER_LENGTH, Frame
from kinespace.stream.recognition import Recognition
from kinespace.stream.recognizer.recognizer import Recognizer
from kinespace.stream.recognizer.settings import Settings


def recognise(library: MotionLibrary, clip: Clip, settings: Settings | None = None) -> list[Recognition]:
    """Recognise a clip, as it would be live.

    Parameters
    ----------
    library
        The motions to compare with, over the joints that the clip has: five of them at least.
    clip
        A recording of one performer, with our names for its joints, as `read_recordings` gives it.
    settings
        Of the recogniser.

    Returns
    -------
    The answers, by time: thirty a second unless `settings.hop` says otherwise. Times are seconds from the clip's start.

    Raises
    ------
    ValueError
        It is no clip.
    SkeletonMismatchError
        Library and clip share fewer than five joints.
    """
    if not isinstance(clip, Clip):
        raise ValueError(f"clip: expected a Clip, got {type(clip).__name__}")  # noqa: TRY004 - as all our caller's mistakes
    shared = library.restricted_to(clip.skeleton.joints)
    recognizer, over = Recognizer(shared, settings), clip.over(shared.skeleton)
    name = (clip.actor or clip.name or "performer")[:MAX_PERFORMER_LENGTH]
    frames = (Frame(name, time, each) for time, each in zip(over.times.tolist(), over.positions, strict=True))
    return [answer for frame in frames if (answer := recognizer.push(frame))]
