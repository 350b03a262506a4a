"""The slow twin of every computation: textbook loops with which the product's fast code is compared.

Nothing here calls the product. What is written in the papers and in the Acclaim specification is written out again,
one number at a time where that is bearable.
"""

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]


# --- distances, principal axis ------------------------------------------------------------------------------------


def distance_rows(positions: Matrix) -> Matrix:
    """Measure every pair of joints, the first below the second, frame by frame, pair by pair."""
    return np.array([[math.dist(*pair) for pair in combinations(posture, 2)] for posture in positions.tolist()])


def first_axis_by_svd(rows: Matrix) -> Matrix:
    """Find the first principal axis as the paper does, by the singular value decomposition of the centred rows."""
    return np.linalg.svd(rows - rows.mean(axis=0), full_matrices=False)[2][0]


# --- match and retrieval -----------------------------------------------------------------------------------------


def score(first: Iterable[float], second: Iterable[float]) -> float:
    """Compare two axes: the absolute inner product."""
    return abs(math.fsum(a * b for a, b in zip(first, second, strict=True)))


def neighbours(scores: Matrix, asking: int, allowed: Iterable[int]) -> list[int]:
    """Sort the motions that one may find, nearest first, the earlier first among equals."""
    return sorted(allowed, key=lambda other: (-float(scores[asking, other]), other))


def allowed(asking: int, actors: Sequence[str], protocol: str) -> list[int]:
    """Say which motions one may be compared with."""
    others = [other for other in range(len(actors)) if other != asking]
    if protocol == "leave-one-out":
        return others
    if protocol == "actor-held-out":
        return [other for other in others if actors[other] != actors[asking]]
    library = {"bd", "bk", "dg"}
    return [] if actors[asking] in library else [other for other in others if actors[other] in library]


def retrieval(scores: Matrix, classes: Sequence[str], actors: Sequence[str], protocol: str) -> list[tuple[bool, bool]]:
    """Say of each motion that finds others whether the nearest, and one of the two nearest, is of its class."""
    tally = list[tuple[bool, bool]]()
    for asking, own in enumerate(classes):
        found = [classes[other] for other in neighbours(scores, asking, allowed(asking, actors, protocol))]
        if found:
            tally.append((found[0] == own, own in found[:2]))
    return tally


# --- Acclaim files -----------------------------------------------------------------------------------------------


def words_of(path: Path) -> list[list[str]]:
    """Split a file into the words of its lines, comments and empty lines left out."""
    text = path.read_bytes().decode("latin-1")
    lines = [line.split("#")[0].split() for line in text.split("\n")]
    return [words for words in lines if words]


class Asf:
    """The words of an ASF that is known to be good: units, the root's lines and each bone's lines by their first word.

    `joints` are the root, then the bones in the order in which the hierarchy names them as children.
    """

    def __init__(self, path: Path) -> None:
        self.units, self.root, self.bones = {"length": ["1.0"], "angle": ["deg"]}, dict[str, list[str]](), {}
        self.children, self.joints = defaultdict[str, list[str]](list), ["root"]
        bone, section = dict[str, list[str]](), ""
        for first, *rest in words_of(path):
            if first.startswith(":"):
                section = first
            elif section in (":units", ":root"):
                {":units": self.units, ":root": self.root}[section][first] = rest
            elif section == ":bonedata" and first == "begin":
                bone = {}
            elif section == ":bonedata" and first == "end":
                self.bones[bone["name"][0]] = bone
            elif section == ":bonedata":
                bone[first] = rest
            elif section == ":hierarchy" and first not in ("begin", "end"):
                self.children[first] += rest
                self.joints += rest
        self.angle, self.metres = self.units["angle"][0], 0.0254 / float(self.units["length"][0])


def read_amc(path: Path, angle: str) -> tuple[str, list[dict[str, list[float]]]]:
    """Read an AMC that is known to be good: its unit of angle, if not the skeleton's, and each frame's bones."""
    frames = list[dict[str, list[float]]]()
    for first, *rest in words_of(path):
        if first.upper() in (":DEGREES", ":RADIANS"):
            angle = first[1:4].lower()
        elif first.isdigit():
            frames.append({})
        elif not first.startswith(":"):
            frames[-1][first] = [float(word) for word in rest]
    return angle, frames


# --- forward kinematics ------------------------------------------------------------------------------------------


def turn_about(letter: str, angle: float) -> Matrix:
    """Turn about one axis by an angle in radians, counted by the right hand."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array(
        {
            "x": [[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]],
            "y": [[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]],
            "z": [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]],
        }[letter]
    )


def turn_in_order(order: str, angles: Mapping[str, float]) -> Matrix:
    """Turn about the axes in turn, the first letter first: XYZ is Rz · Ry · Rx; a letter without an angle is still."""
    matrix = np.eye(3)
    for letter in order.lower():
        matrix = turn_about(letter, angles.get(letter, 0.0)) @ matrix
    return matrix


def radians(value: float, unit: str) -> float:
    """Convert an angle of either unit."""
    return math.radians(value) if unit == "deg" else value


def _axis_frame(order: str, words: Sequence[str], unit: str) -> Matrix:
    """Turn by three angles given in the order of the letters."""
    return turn_in_order(
        order, {letter: radians(float(word), unit) for letter, word in zip(order.lower(), words[:3], strict=True)}
    )


def posture(asf: Asf, frame: Mapping[str, Sequence[float]], angle: str) -> dict[str, Matrix]:
    """Stand a body in one frame: every joint's place in metres, by recursion from the root."""
    places: dict[str, Matrix] = {}
    values = dict(zip((word.lower() for word in asf.root["order"]), frame.get("root", []), strict=True))
    shift = [float(word) for word in asf.root.get("position", ["0"] * 3)]
    places["root"] = np.array([(shift[i] + values.get(f"t{'xyz'[i]}", 0.0)) * asf.metres for i in range(3)])
    order = asf.root["axis"][0]
    frame_of_root = _axis_frame(order, asf.root.get("orientation", ["0"] * 3), asf.angle)
    turns = {letter: radians(values[f"r{letter}"], angle) for letter in "xyz" if f"r{letter}" in values}
    turned = frame_of_root @ turn_in_order(order, turns) @ np.linalg.inv(frame_of_root)

    def hang(parent: str, parent_turned: Matrix) -> None:
        for name in asf.children[parent]:
            bone = asf.bones[name]
            order = bone["axis"][3] if len(bone["axis"]) > 3 else "xyz"
            dof = [word.lower() for word in bone.get("dof", [])]
            turns = {word[1]: radians(value, angle) for word, value in zip(dof, frame.get(name, []), strict=True)}
            own = _axis_frame(order, bone["axis"], asf.angle)
            turned = parent_turned @ own @ turn_in_order(order, turns) @ np.linalg.inv(own)
            direction = np.array([float(word) for word in bone["direction"][:3]])
            places[name] = places[parent] + turned @ (float(bone["length"][0]) * direction) * asf.metres
            hang(name, turned)

    hang("root", turned)
    return places


def clip_positions(asf_path: Path, amc_path: Path, every: int = 1) -> Matrix:
    """Stand a body in every n-th frame of a recording, shape (frames, joints, 3), metres; gaps are not filled."""
    asf = Asf(asf_path)
    angle, frames = read_amc(amc_path, asf.angle)
    postures = [posture(asf, frame, angle) for frame in frames[::every]]
    return np.array([[places[joint] for joint in asf.joints] for places in postures])


# --- BVH ---------------------------------------------------------------------------------------------------------


def bvh_places(joint: Any, numbers: Iterator[float], at: Matrix, turned: Matrix) -> list[Matrix]:  # noqa: ANN401 - any class
    """Place a joint and all joints below it in one frame, by recursion, in the order of the file.

    Parameters
    ----------
    joint
        Has an offset, channels and children, as each child has.
    numbers
        The rest of the frame's.
    at, turned
        Where the parent stands, and its frame.
    """
    own, turn = [*map(float, joint.offset)], np.eye(3)
    for channel in joint.channels:
        axis, value = channel[0].lower(), next(numbers)
        if channel[1:] == "position":
            own["xyz".index(axis)] = value
        else:
            turn = turn @ turn_about(axis, math.radians(value))
    here = at + turned @ np.array(own)
    places = [here]
    for child in joint.children:
        places += bvh_places(child, numbers, here, turned @ turn)
    return places
