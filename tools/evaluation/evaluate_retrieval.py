"""`kinespace evaluate retrieval`: how often a motion's nearest neighbour is of its class.

For every motion, counts whether its nearest other motion is of its class, and whether one of the two nearest is, in the
spaces of joint distances, joint positions and joint rotations. A motion's signature is the leading eigenvector of its
numbers' covariance (eigenvector), or the first singular vector of the numbers as they are (raw). Draws the paper's
confusion matrices.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from enum import StrEnum
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from kinespace.library import Clip, distance_rows, signature_of, similarity
from kinespace.stream.outputs.sink import extra
from kinespace.tools.cli import console
from kinespace.tools.evaluation.harness import add_sources, distinct, motions_at
from kinespace.tools.evaluation.scores import Figure, basis_of, interval, intervals_of, ratio, values_of, write_rows

_COLUMNS = (
    "compared {space} {signature} | protocol {protocol} | motions {motions} | nearest {nearest:.1%} | 95 % {sure} | "
    "of two {two_nearest:.1%} | splits' mean {mean:.1%} | worst {worst:.1%}"
)
#: Classes whose matrix has room in a terminal.
_MOST = 16
_NAME = 24


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    add_sources(parser, "the built-in motions, which have no rotations")
    parser.set_defaults(clips=True)
    parser.add_argument("--signature", choices=[*map(str, SignatureKind)], help="default: both")
    parser.add_argument("--protocol", choices=[*map(str, RetrievalProtocol)], help="default: all")
    text = "write a row for each motion and comparison: the two nearest, their products, and whether they are right"
    parser.add_argument("--answers", type=Path, metavar="CSV", help=text)
    text = "draw the confusion matrices of the three spaces (.png, .svg, .pdf; needs the extra `pictures`)"
    parser.add_argument("--picture", type=Path, metavar="FILE", help=text)


def run(options: argparse.Namespace) -> None:
    """Run the paper's experiment and print the results."""
    for output in filter(None, (options.answers, options.picture)):
        console.require_place_for_report(output, options)
    plot = extra("matplotlib.figure", "pictures") if options.picture else None
    clips = motions_at(options)
    labels = Labels(np.array([clip.class_name for clip in clips]), np.array([clip.actor for clip in clips]))
    ways = _ways(clips, options.signature)
    names = distinct(" ".join(filter(None, (clip.class_name, clip.actor, clip.take))) for clip in clips)
    protocols = [RetrievalProtocol(options.protocol)] if options.protocol else _protocols(clips)
    unnamed = [clip.name for clip in clips if not clip.actor]
    if unnamed and RetrievalProtocol.LEAVE_ONE_OUT not in protocols:
        raise ValueError(f"{unnamed[0]}: expected a name with the actor in it, as HDM05's have; --actor-in says where")
    scores, rows = list[dict[str, Any]](), list[dict[str, Any]]()
    # The paper's conclusion shows where the person is held out, to the letter of the paper.
    drawn, matrices = (ways[-1][1], protocols[:2][-1]), dict[str, NDArray[np.float64]]()
    for space, kind in console.progress(ways, "Comparing", len(ways)):
        signatures = signatures_of(clips, space, kind)
        products = similarity(signatures, signatures.T)
        for protocol in protocols:
            found = retrieve(products, labels, candidates(labels, protocol))
            named = {"space": space, "signature": kind, "protocol": protocol}
            scores.append(named | _scored(clips, found, labels) | _of_splits(products, labels, protocol))
            rows += [named | row for row in _rows(clips, names, found)]
            if (kind, protocol) == drawn:
                matrices[space] = found.confusion(labels)[1]
    if options.answers:
        write_rows(options.answers, rows)
    if plot:
        _draw(plot.Figure, options.picture, np.unique(labels.classes).tolist(), matrices)
    how = ", ".join(drawn).replace("-", " ")
    console.tell(options, scores, *_shown(clips, scores), *_confusions(labels, matrices, how))


def _protocols(clips: Sequence[Clip]) -> list[RetrievalProtocol]:
    """List the protocols that the known actors allow."""
    actors, library = {clip.actor for clip in clips}, set(SPLIT_LIBRARY_ACTORS)
    if len(actors) < 2 or "" in actors:
        return [RetrievalProtocol.LEAVE_ONE_OUT]
    divided = actors & library and actors - library
    return [*RetrievalProtocol] if divided else [RetrievalProtocol.LEAVE_ONE_OUT, RetrievalProtocol.ACTOR_HELD_OUT]


def _ways(clips: Sequence[Clip], signature: str | None) -> list[tuple[Space, SignatureKind]]:
    """List the signatures, and the spaces for which all motions have numbers."""
    angles = {clip.rotations.shape[1] for clip in clips}
    spaces = [each for each in Space if each is not Space.ROTATIONS or (len(angles) == 1 and 0 not in angles)]
    return [(space, kind) for kind in SignatureKind if signature in (None, kind) for space in spaces]


def _scored(clips: Sequence[Clip], found: Retrieval, labels: Labels) -> dict[str, Any]:
    """Score one protocol: the shares of the motions that asked, and their confusion by class."""
    asking = [clips[index] for index in found.asking]
    basis = basis_of([round(sum(clip.duration for clip in asking), 3)], [clip.actor for clip in asking])
    classes, matrix = found.confusion(labels)
    return {
        "motions": len(asking),
        "classes": len(classes),
        **{name: round(value or 0.0, 4) for name, value in values_of(found.shares).items()},
        "seconds": basis["seconds"],
        "persons": basis["persons"],
        "intervals": intervals_of(found.shares),
        "confusion": {
            name: {classes[place]: round(float(row[place]), 4) for place in np.flatnonzero(row)}
            for name, row in zip(classes, matrix, strict=True)
        },
    }


def _of_splits(products: NDArray[np.floating], labels: Labels, protocol: RetrievalProtocol) -> dict[str, Any]:
    """Give the mean and the worst of five actors' ten splits."""
    actors = sorted({*labels.actors.tolist()})
    if protocol is not RetrievalProtocol.SPLIT or len(actors) != _ACTORS:
        return {"splits": None}
    shares = dict[tuple[str, ...], float]()
    for library in combinations(actors, len(SPLIT_LIBRARY_ACTORS)):
        found = retrieve(products, labels, candidates(labels, protocol, library))
        shares[library] = float(found.right[:, 0].mean())
    worst = min(shares, key=shares.__getitem__)
    return {"splits": {"mean": float(np.mean([*shares.values()])), "worst": shares[worst], "worst_library": worst}}


def _rows(clips: Sequence[Clip], names: Sequence[str], found: Retrieval) -> Iterator[dict[str, Any]]:
    """Give a row for each motion that asked: the two nearest, their products, and whether they are right."""
    for asking, places, products, right in zip(*(each.tolist() for each in found), strict=True):
        row = {"query": names[asking], "class": clips[asking].class_name, "person": clips[asking].actor}
        for which, place, product in zip(("nearest", "second"), places, products, strict=True):
            row |= {which: names[place], f"{which}_class": clips[place].class_name, f"{which}_product": product}
        yield row | {"right": int(right[0]), "one_of_two_right": int(right[1])}


def _shown(clips: Sequence[Clip], scores: Sequence[Mapping[str, Any]]) -> tuple[str, Table]:
    """Draw the shares that are right."""
    persons, classes = {clip.actor for clip in clips} - {""}, {clip.class_name for clip in clips}
    seconds = f"{sum(clip.duration for clip in clips):.0f} s, {len(persons) or 'no'} known persons; 95 %: by motions"
    # A narrow terminal breaks lines at spaces.
    written = [
        {**each, **(each["splits"] or {"mean": None, "worst": None}), "protocol": each["protocol"].replace("-", " ")}
        | {"sure": interval(each["intervals"]["nearest"], "{:.0%}")}
        for each in scores
    ]
    whose = console.counted(len(persons), "person") if persons else "unknown persons"
    motions = f"{console.counted(len(clips), 'motion')} of {console.counted(len(classes), 'class', 'classes')}"
    title = "Of how many motions is the nearest neighbour of their class?"
    table = console.scores_of(written, _COLUMNS, title=title, caption=seconds, names=2)
    return f"{motions} by {whose}", table


def _confusions(labels: Labels, matrices: Mapping[str, NDArray[np.float64]], how: str) -> Iterator[Table | str]:
    """Draw each class's share of right neighbours, and the confusion matrices as far as a terminal has room."""
    classes, counts = np.unique(labels.classes, return_counts=True)
    rows = [
        (f"{place} {name}", str(count), *(f"{matrix[place - 1, place - 1]:.0%}" for matrix in matrices.values()))
        for place, (name, count) in enumerate(zip(classes.tolist(), counts.tolist(), strict=True), 1)
    ]
    yield console.table_of(f"Right by class ({how})", ("class", "motions", *matrices), rows)
    if len(classes) > _MOST:
        yield f"--picture FILE draws the confusion of {len(classes)} classes; --json lists it"
        return
    for space, matrix in matrices.items():
        yield f"\nConfusion by {space} ({how}): of a row's motions, the % whose nearest is of a column's class"
        yield " " * _NAME + "".join(f"{place:4}" for place in range(1, len(classes) + 1))
        for name, shares in zip(classes.tolist(), matrix.tolist(), strict=True):
            cells = "".join(f"{100 * each:4.0f}" if each else "   ·" for each in shares)
            yield f"{console.shortened(name, _NAME - 1):{_NAME}}{cells}"


def _draw(new: Any, path: Path, classes: Sequence[str], matrices: Mapping[str, NDArray[np.float64]]) -> None:  # noqa: ANN401 - matplotlib's
    """Draw the paper's figure 2."""
    side = max(3.0, 0.13 * len(classes))
    figure = new(figsize=(len(matrices) * (side + 0.2), side))
    for number, (space, matrix) in enumerate(matrices.items(), 1):
        axes = figure.add_subplot(1, len(matrices), number, title=space)
        axes.imshow(matrix, cmap="Greys", vmin=0, vmax=1)
        axes.set_xticks(range(len(classes)), classes, rotation=90, fontsize=6)
        axes.set_yticks(range(len(classes)), classes if number == 1 else [], fontsize=6)
    figure.savefig(path, bbox_inches="tight")


class Space(StrEnum):
    """The numbers that describe a frame."""

    DISTANCES = "distances"
    POSITIONS = "positions"
    ROTATIONS = "rotations"


class SignatureKind(StrEnum):
    """The paper's signature, in its two readings: motions are compared by the absolute inner product."""

    #: The leading eigenvector of the covariance: the numbers are centred.
    EIGENVECTOR = "eigenvector"
    #: The first singular vector of the numbers as they are.
    RAW = "raw"


class RetrievalProtocol(StrEnum):
    """The motions with which a motion may be compared."""

    LEAVE_ONE_OUT = "leave-one-out"
    ACTOR_HELD_OUT = "actor-held-out"
    SPLIT = "split"


#: The actors of the split in the literature: their motions make the library, the other actors' motions ask.
SPLIT_LIBRARY_ACTORS = ("bd", "bk", "dg")
#: HDM05's actors.
_ACTORS = 5


class Labels(NamedTuple):
    """Class and actor of each motion, each of shape (motions,)."""

    classes: NDArray[np.str_]
    actors: NDArray[np.str_]


class Retrieval(NamedTuple):
    """The outcome of one protocol in one space.

    Attributes
    ----------
    asking
        Indices of the motions that asked, shape (asking,).
    found
        Indices of the nearest and the second nearest motion of each, shape (asking, 2).
    products
        Their similarity, shape (asking, 2).
    right
        Whether the nearest, and whether one of the two nearest, is of their class, shape (asking, 2).
    """

    asking: NDArray[np.intp]
    found: NDArray[np.intp]
    products: NDArray[np.floating]
    right: NDArray[np.bool_]

    @property
    def shares(self) -> dict[str, Figure]:
        """The shares of the motions that asked whose nearest, or one of whose two nearest, is of their class.

        The latter is the paper's 2-nearest-neighbour rate.
        """
        one, both = [1.0] * len(self.right), zip(("nearest", "two_nearest"), self.right.T.tolist(), strict=True)
        return {name: ratio(right, one) for name, right in both}

    def confusion(self, labels: Labels) -> tuple[list[str], NDArray[np.float64]]:
        """Give the classes that asked or were found, and the paper's figure 2 of them, shape (classes, classes).

        In row i and column j stands the share of the motions of class i whose nearest motion is of class j; a row of
        zeros is of a class of which no motion asked.
        """
        classes, codes = np.unique(labels.classes, return_inverse=True)
        counts = np.zeros((len(classes), len(classes)))
        np.add.at(counts, (codes[self.asking], codes[self.found[:, 0]]), 1.0)
        return classes.tolist(), counts / np.maximum(counts.sum(axis=1, keepdims=True), 1.0)


def signatures_of(clips: Sequence[Clip], space: Space, kind: SignatureKind) -> NDArray[np.float64]:
    """Compute each clip's signature in one space, shape (clips, numbers of a frame)."""
    centred = kind is SignatureKind.EIGENVECTOR
    return np.array([signature_of(_frame_rows(clip, space), centred=centred) for clip in clips])


def _frame_rows(clip: Clip, space: Space) -> NDArray[np.float64]:
    if space is Space.DISTANCES:
        return distance_rows(clip.positions, clip.skeleton)
    if space is Space.POSITIONS:
        return clip.positions.reshape(clip.frames, -1).astype(np.float64)
    return clip.rotations


def candidates(
    labels: Labels, protocol: RetrievalProtocol, library_actors: Sequence[str] = SPLIT_LIBRARY_ACTORS
) -> NDArray[np.bool_]:
    """Say which motions (columns) each motion (rows) may find, shape (motions, motions); an empty row does not ask.

    Parameters
    ----------
    labels
        Class and actor of each.
    protocol
        Which motions may be compared with which.
    library_actors
        The actors whose motions make the library of `RetrievalProtocol.SPLIT`.
    """
    if protocol is RetrievalProtocol.LEAVE_ONE_OUT:
        return ~np.eye(len(labels.actors), dtype=bool)
    if protocol is RetrievalProtocol.ACTOR_HELD_OUT:
        return np.not_equal.outer(labels.actors, labels.actors)
    in_library = np.isin(labels.actors, library_actors)
    return ~in_library[:, None] & in_library[None, :]


def retrieve(products: NDArray[np.floating], labels: Labels, allowed: NDArray[np.bool_]) -> Retrieval:
    """Find the two nearest motions of each, and whether they are of the asking motion's class.

    Parameters
    ----------
    products
        Of every motion with every other, shape (motions, motions), from `similarity`.
    labels
        Class and actor of each.
    allowed
        Which motions each may find, from `candidates`.

    Raises
    ------
    ValueError
        No motion has two others to be compared with (with one actor alone, for instance).
    """
    asking = np.flatnonzero(allowed.sum(axis=1) >= 2)
    if not asking.size:
        raise ValueError("--protocol: expected a motion that may be compared with two others, got none")
    nearest = np.where(allowed, products, -np.inf)[asking]
    found = np.argsort(-nearest, axis=1, kind="stable")[:, :2]
    right = np.logical_or.accumulate(labels.classes[found] == labels.classes[asking][:, None], axis=1)
    return Retrieval(asking, found, np.take_along_axis(nearest, found, axis=1), right)
