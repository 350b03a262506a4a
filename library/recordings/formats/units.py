"""Units of length in recordings: units that a file names, and a rule for files that name none."""

import math
import tomllib
from collections.abc import Sequence
from importlib import resources

import numpy as np
from numpy.typing import NDArray

#: Words in recordings, by kind.
WORDS = tomllib.loads((resources.files("kinespace.library.recordings.formats") / "words.toml").read_text("utf-8"))
#: Metres of each unit, under the names and abbreviations that files use, in lower case.
METRES = {word: float(metres) for metres, words in WORDS["metres"].items() for word in words}
#: The size of a person, in the file's numbers, up to which the unit is a metre. A crouching child and a very tall
#: person are far from this limit and the next.
_MAX_IN_METRES = 16.0
#: The size up to which the unit is a centimetre; beyond, it is a millimetre.
_MAX_IN_CENTIMETRES = 500.0


def metres_of(unit: str) -> float | None:
    """Give the metres of a unit's name, or of a number that says them itself; None for any other text.

    A name may be cut short, as C3D's fields of four letters do it: `mete`.
    """
    name = unit.strip().strip("()[].").lower()
    meant = {METRES[name]} if name in METRES else {each for word, each in METRES.items() if word.startswith(name)}
    if len(meant) == 1 and (name in METRES or len(name) > 2):
        return meant.pop()
    try:
        metres = float(name)
    except ValueError:
        return None
    return metres if 0 < metres < math.inf else None


def guessed_metres(positions: NDArray[np.float64], names: Sequence[str] = ()) -> float:
    """Guess the metres of a file's unit from a person's size in it; positions (frames, joints, 3), NaN where not seen.

    The size is the diagonal of the box around the joints, usual for the frames in which two joints or more are seen.
    People differ less than tenfold in size, so metres, centimetres and millimetres can be distinguished. Any other unit
    is taken for the nearest of these: distances then have another scale, which recognition does not depend on. A pelvis
    alone, by its `names`, is a fifth of a person.
    """
    seen = positions[np.isfinite(positions).all(axis=2).sum(axis=1) > 1]
    if not len(seen):
        return 1.0
    boxes = np.nanmax(seen, axis=1) - np.nanmin(seen, axis=1)
    size = float(np.median(np.linalg.norm(boxes, axis=1)))
    if names and all(any(word in name.lower() for word in WORDS["columns"]["pelvis"]) for name in names):
        size *= 5
    if size <= _MAX_IN_METRES:
        return 1.0
    return 0.01 if size <= _MAX_IN_CENTIMETRES else 0.001
