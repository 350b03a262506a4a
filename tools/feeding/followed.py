"""A recorded performer's progress in each motion, frame by frame, for `kinespace convert --progress`."""

from __future__ import annotations

from array import array
from typing import TYPE_CHECKING

import numpy as np

from kinespace.stream.frame import Announcement, Frame
from kinespace.stream.recognizer import Performers, Settings

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from numpy.typing import NDArray

    from kinespace.library import MotionLibrary

#: The numbers of a progress, as the arrays are called.
_NUMBERS = ("phase", "speed", "amplitude", "sure", "scrub", "cycles")
_PERFORMER = "performer"


class Followed:
    """Recognises one performer's frames as they pass, and keeps how far each is in its motion.

    Parameters
    ----------
    library
        The motions to recognise.
    joints
        Names of the joints of a frame.
    """

    def __init__(self, library: MotionLibrary, joints: tuple[str, ...]) -> None:
        self._performers = Performers(library, Settings(progress=True))
        self._joints = joints
        self._indices = array("q")
        self._numbers = {name: array("d") for name in _NUMBERS}

    def watch(
        self, postures: Iterable[tuple[float, NDArray[np.floating]]]
    ) -> Iterator[tuple[float, NDArray[np.floating]]]:
        """Pass frames on, times in seconds and positions (joints, 3) in metres, and recognise them.

        Raises
        ------
        ValueError
            The library's joints cannot be found among the frames'.
        """
        self._performers.announce(Announcement(_PERFORMER, self._joints), 0.0)
        if reasons := self._performers.refused:
            raise ValueError(f"--progress: {reasons[_PERFORMER]}")
        index, told = -1, (np.nan,) * len(_NUMBERS)
        for moment, positions in postures:
            recognition = self._performers.push(Frame(_PERFORMER, moment, positions), moment)
            if recognition:
                index, followed = recognition.progress_index, recognition.progress
                told = tuple(getattr(followed, name) if followed else np.nan for name in _NUMBERS)
            self._indices.append(index)
            for name, number in zip(_NUMBERS, told, strict=True):
                self._numbers[name].append(number)
            yield moment, positions

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """Give `classes`, of each frame the index of its `class`, -1 for none, and its numbers, each (frames,)."""
        numbers: dict[str, NDArray[np.generic]] = {name: np.array(each) for name, each in self._numbers.items()}
        return {"classes": np.array(self._performers.classes), "class": np.array(self._indices, np.int64), **numbers}
