"""C3D recordings (www.c3d.org) read into clips, by the package c3d.

A C3D holds labelled points: markers, joint centres that a model computed, and often, among the same labels, angles,
forces and other results that are no positions. These results (the file lists them in POINT:ANGLES and similar
parameters) are left out unless they are asked for by name.

The package reads header and parameters, whichever of the three kinds of processor wrote them. Of the libraries for C3D
it is the one that reads all three; and it is small, needs numpy alone, and raises an error for a broken file, where
ezc3d can end the process. The frames are read here: the package's own loop takes them one by one, none of a file of
65,535, and by counts that files often have wrong. No size in a file is believed before it is compared with its bytes.
"""

import io
import math
import struct
import warnings
from collections.abc import Sequence
from contextlib import suppress
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinespace.library import memory
from kinespace.library.clip import Clip
from kinespace.library.recordings.formats.errors import RecordingError
from kinespace.library.recordings.formats.markers.marker_clip import clips_of_markers
from kinespace.library.recordings.formats.measures import metres_of, words_of
from kinespace.library.recordings.formats.texts import encoding_of

#: Parameters of the group POINT in which files list the points that are no positions.
_NO_PLACES = ("ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS", "REACTIONS")
_BLOCK = 512
#: The number from which on a header's 16 bits count frames anew.
_WRAP = 65_536


def _opened(content: bytes) -> Any:  # noqa: ANN401 - the package has no types
    """Read header and parameters."""
    from c3d import Reader  # noqa: PLC0415 - only files of this kind need it

    class Lenient(Reader):  # type: ignore[misc]
        """Believes the header where it and the parameters differ, and parameters before one that is damaged."""

        whole = False

        def _check_metadata(self) -> None:
            self.whole = True

        def __init__(self, file: io.BytesIO) -> None:
            with suppress(struct.error, KeyError):
                super().__init__(file)

    # Without the header's count of events, which may be beyond its places for them, and without the frames.
    front = bytearray(content[:300] + b"\0\0" + content[302 : (content[0] + 255) * _BLOCK])
    # Parameters are read to their end where they have no count of blocks; another kind of processor is none.
    place = (content[0] - 1) * _BLOCK + 2
    blocks, maker = content[place : place + 2]
    front[place : place + 2] = [blocks or 255, maker if maker in (84, 85, 86) else 84]
    with warnings.catch_warnings(action="ignore"):
        return Lenient(io.BytesIO(front))


def _texts(name: str, said: Any, group: str = "POINT") -> list[str]:  # noqa: ANN401
    """Give the texts of a parameter of a group and of the parameters that continue it.

    A parameter holds 255 entries at most; LABELS continues in LABELS2.
    """
    names = (name, *(f"{name}{number}" for number in range(2, 100)))
    held = [parameter for each in names if (parameter := said.get(f"{group}:{each}")) and parameter.bytes]
    if any(parameter.bytes_per_element != -1 for parameter in held):
        raise ValueError(f"expected texts in {group}:{name}, got numbers")
    fields = (field.partition(b"\0")[0].strip() for each in held for field in np.ravel(each.bytes_array).tolist())
    return [field.decode(encoding_of(field), "replace") for field in fields]


def _number(said: Any, name: str) -> float:  # noqa: ANN401
    """Give the number that a parameter holds, a real or a whole one, as some programs write; 0 where it has none."""
    held = said.get(name)
    if not held or not held.bytes:
        return 0.0
    return float(getattr(held, {1: "uint8_value", 4: "float_value"}.get(held.bytes_per_element, "uint16_value")))


def _numbers(said: Any, content: bytes, block: int, scale: float, each: int) -> NDArray[np.float64]:  # noqa: ANN401
    """Read all numbers from a block on as frames of so many numbers each."""
    begin = (block - 1) * _BLOCK
    held = content[begin:] if begin > 0 else b""
    size = (4 if scale < 0 else 2) * each
    held = held[: len(held) // size * size]
    order = ">" if said.proc_type == "MIPS" else "<"
    if scale < 0 and said.proc_type == "DEC":
        # Its words are swapped, and its numbers are four times as large.
        held = np.frombuffer(held, "<u2").reshape(-1, 2)[:, ::-1].tobytes()
        return np.frombuffer(held, "<f4").reshape(-1, each) / 4
    return np.frombuffer(held, order + ("f4" if scale < 0 else "i2")).reshape(-1, each)


def _announced(said: Any) -> int:  # noqa: ANN401
    """Give the number of frames by the header (0: it does not say it), or by numbers of two words in TRIAL."""
    first, last = said.header.first_frame, said.header.last_frame
    words = [said.get(f"TRIAL:ACTUAL_{end}_FIELD") for end in ("START", "END")]
    if last == _WRAP - 1 and all(each is not None and each.total_bytes == 4 for each in words):
        first, last = (int(each.uint16_value) + int(each.uint16_array.ravel()[1]) * _WRAP for each in words)
        return max(last - first + 1, 0)
    return (int(last) - int(first) + 1) % _WRAP if last else 0


def _layout(said: Any, held: int, announced: int) -> tuple[int, int, float]:  # noqa: ANN401
    """Give points and other numbers of a frame, and the scale.

    Where header and parameters differ those count by which `held` bytes are as many frames as announced.
    """
    header, points = said.header, (said.header.point_count, int(_number(said, "POINT:USED")))
    per = round(_number(said, "ANALOG:RATE") / (_number(said, "POINT:RATE") or math.inf))
    others = header.analog_count, int(_number(said, "ANALOG:USED")) * max(per, 1)
    scales = header.scale_factor, _number(said, "POINT:SCALE") or math.nan

    def apart(kind: tuple[int, int, float]) -> float:
        size = (4 if kind[2] < 0 else 2) * (4 * kind[0] + kind[1])
        if not size or not math.isfinite(kind[2]):
            return math.inf
        fits = 0 <= held - announced * size < _BLOCK
        return 0.0 if fits else abs(held / size - announced)

    if not announced:
        return points[0], others[0], scales[0]
    best = min(product(points, others[:1], scales), key=apart)
    # Other numbers may be counted wrong, and scales say whole numbers where there are reals: such a layout must fit,
    # because files may be cut off, too.
    guesses = product(points, others, (*scales, *(-each for each in scales if each > 0)))
    return best if not apart(best) else next((each for each in guesses if not apart(each)), best)


def _counted(numbers: NDArray[np.float64], announced: int, count: int) -> int:
    """Count the frames: as the header says, unless the bytes, or POINT:FRAMES and the bytes, tell of others."""
    least = announced if announced <= len(numbers) else 0
    unsaid = not least or announced == _WRAP - 1
    if unsaid or len(numbers) >= announced + _WRAP:
        # A header that counts modulo 65,536, no further, too far, or not at all: the bytes tell.
        frames = len(numbers) if unsaid else announced + (len(numbers) - announced) // _WRAP * _WRAP
        while frames > least and not numbers[frames - 1].any():
            frames -= 1  # the rest of the last block
        return frames
    to_the_end = count <= len(numbers) and numbers[count:].nbytes < _BLOCK
    return count if count > announced and to_the_end else announced


def _frames(said: Any, content: bytes) -> tuple[NDArray[np.float64], list[str]]:  # noqa: ANN401
    """Read the points, (frames, points, 3) in the file's unit, NaN where one is out of sight, and remarks."""
    begin = said.header.parameter_block
    # Where the header does not say it, frames follow the parameters, whose third byte counts their blocks.
    block = said.header.data_block or begin + content[(begin - 1) * _BLOCK + 2]
    announced, width, place = _announced(said), 4, 0
    turns, matrices = (int(_number(said, f"ROTATION:{name}")) for name in ("USED", "DATA_START"))
    if turns and matrices > block and said.header.point_count:
        # Matrices of segments stand behind the points.
        content = content[: (matrices - 1) * _BLOCK]
    count = int(_number(said, "POINT:FRAMES"))
    points, analog, scale = _layout(said, len(content) - (block - 1) * _BLOCK, announced or count)
    if turns and not points:
        # Theia's files hold them in place of points: 16 numbers, a place in their last column.
        points, block, width, place, analog, scale = turns, matrices, 17, 12, 0, -1.0
    if points < 2:
        raise ValueError(f"expected at least 2 points, got {points}: a file of forces or other measurements")
    if not math.isfinite(scale):
        raise ValueError(f"expected a C3D, got an impossible header ({points} points, {announced} frames)")
    each = width * points + analog
    numbers, notes = _numbers(said, content, block, scale, each), list[str]()
    frames = _counted(numbers, announced, count)
    if not frames:
        raise ValueError("expected frames, got a file that ends before its first one")
    if frames != announced:
        notes.append(f"frames: the header says {announced}, there are {frames}: these are taken")
    memory.require_numbers(frames * points * 3)
    fields = numbers[:frames, : width * points].reshape(frames, points, width).astype(np.float64)
    positions = fields[:, :, place : place + 3] * (scale if scale > 0 else 1.0)
    gone = fields[:, :, -1] < 0
    if gone.all() and positions.any():
        notes.append("residuals: all say that nothing was seen, beside places: the places are taken")
    else:
        positions[gone] = np.nan
    return positions, notes


def read_clips(
    path: Path, *, metres_per_unit: float | None = None, frame_rate: float | None = None, joints: Sequence[str] = ()
) -> list[Clip]:
    """Read a C3D into a clip for each person that its labels name.

    Parameters
    ----------
    path
        The file.
    metres_per_unit, frame_rate
        Metres of the file's unit, and frames per second; when not given as POINT:UNITS and POINT:RATE say, or as the
        body's size and the header do.
    joints
        Which points, by name (`library.recordings.formats.joint_choice.chosen`); all labelled positions when not given.

    Returns
    -------
    The clips: positions (frames, points, 3) in metres, the skeleton without parents.

    Raises
    ------
    RecordingError
        The file is no C3D, or makes no sense.
    ValueError
        It lacks a point that is asked for, or has fewer than two that are seen.
    OSError
        The file cannot be opened.
    """
    # Some files begin with nothing.
    content = memory.content(path, memory.limit()).lstrip(b"\0")
    try:
        said = _opened(content)
        positions, notes = _frames(said, content)
        if not said.whole:
            notes.append("parameters: one is damaged: those behind it are left out")
        labels = [*(_texts("LABELS", said) or _texts("LABELS", said, "ROTATION")), *[""] * positions.shape[1]]
        labels = [label or f"*{number}" for number, label in enumerate(labels[: positions.shape[1]], start=1)]
        no_places = {label for kind in _NO_PLACES for label in _texts(kind, said)}
        # Some programs list none of them.
        no_places |= {each for each in labels if {f"{w.rstrip('s').upper()}S" for w in words_of(each)} & {*_NO_PLACES}}
        unit = next((each for each in _texts("UNITS", said) if each), "")
        rates = said.header.frame_rate, _number(said, "POINT:RATE")
    except Exception as error:  # the package has any for a file that makes no sense
        got = str(error) if type(error) is ValueError else type(error).__name__
        if got.startswith("expected"):
            raise
        raise RecordingError(f"{path}: expected a C3D, got a damaged or another file: {got[:120]}") from error
    kept = [index for index, label in enumerate(labels) if label in joints or label not in no_places]
    rate = frame_rate or next((float(each) for each in reversed(rates) if 0 < each < math.inf), 0.0)
    if not rate:
        raise ValueError("expected a positive POINT:RATE, got 0; give it with --frame-rate")
    metres = metres_per_unit or metres_of(unit)
    if unit and not metres:
        notes.append(f"units: {unit!r} is no unit: the body's size tells it; --unit names it")
    names = [labels[index] for index in kept]
    return clips_of_markers(path, names, positions[:, kept], rate, joints, metres=metres, notes=notes)
