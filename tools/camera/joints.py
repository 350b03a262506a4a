"""The joints of a body that a camera sees, and a film read as a recording of them."""

from contextlib import closing
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kinespace.library import Clip
from kinespace.library.recordings.formats.markers.marker_clip import clips_of_markers
from kinespace.library.recordings.formats.timed_frames import evened
from kinespace.library.signature.landmark_body import JOINTS, LandmarkBody
from kinespace.stream.feeds import builtin_preset
from kinespace.tools.camera.bodies import Bodies
from kinespace.tools.camera.models import models_at
from kinespace.tools.camera.region import Landmarks

#: Joints that a frame needs at least.
MIN_JOINTS = 5
#: The presence from which on a landmark is taken to be inside of the picture.
_PRESENT = 0.5


def require_extra() -> None:
    """Refuse to go on without the libraries that a camera needs; ImportError says how to get them."""
    try:
        import_module("kinespace.tools.camera.vision")
    except ImportError as error:
        raise ImportError(f"a camera needs OpenCV and LiteRT ({error}): pip install 'kinespace[camera]'") from error


def landmark_body() -> LandmarkBody:
    """Give a maker of bodies of BlazePose's 33 landmarks, by the same names as the preset `mediapipe`."""
    preset = builtin_preset("mediapipe")
    return LandmarkBody([preset.joint_map[name] for name in preset.order])


def upright(landmarks: Landmarks, picture: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Give landmarks as positions (33, 3) with y up and z towards the camera; NaN for those outside of the picture.

    Parameters
    ----------
    landmarks
        Of one body.
    picture
        The picture in which they were found, (height, width, 3).
    """
    height, width = picture.shape[:2]
    turned: NDArray[np.float64] = landmarks.world * np.array([1.0, -1.0, -1.0])
    inside = (landmarks.picture[:, :2] >= 0).all(axis=1) & (landmarks.picture[:, :2] < (width, height)).all(axis=1)
    turned[~inside | (landmarks.present < _PRESENT)] = np.nan
    return turned


def film_clip(path: Path) -> Clip:
    """Read a film as a recording of one body, which begins with the film; joints that were not seen are on lines.

    Raises
    ------
    ImportError
        The extra is not installed.
    OSError
        Models or film cannot be opened.
    ValueError
        A body is in fewer than two pictures, or a joint is missing for long.
    """
    require_extra()
    from kinespace.tools.camera import film, networks  # noqa: PLC0415 - need an extra

    bodies, joints = Bodies(networks.Networks(models_at(None, "full")), 1, "camera"), landmark_body()
    times, positions = [], []
    with closing(film.Film(str(path), lambda: False, paced=False)) as pictures:
        for picture in pictures:
            for each in bodies.seen(picture.pixels, picture.time):
                times.append(picture.time)
                positions.append(joints.of(upright(each.landmarks, picture.pixels)))
    if len(times) < 2:
        raise ValueError(f"{path}: no body in its {pictures.taken} pictures")
    even = evened(np.array(times), np.array(positions), begin=film.FIRST)
    return replace(clips_of_markers(path, JOINTS, even.positions, even.rate, ())[0], gaps=even.gaps)
