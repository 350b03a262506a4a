"""`kinespace evaluate show`: taught gestures among everyday movement, as in a show.

A performer of the built-in library teaches some gestures by few examples each, without a library. Then everyday
movement is played, put on the performer's own bones, and every 25 seconds, behind a recording's end, another of the
performer's motions of these gestures. A word is right from a tenth of a second before such a motion to a second behind
it (`done`: one and a half), once; every other word is false. Without --movement the motions of the library's other
classes are the everyday movement. With --beside the gestures are taught beside the built-in library, whose own words
count neither way.
"""

import argparse
from collections import defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinespace.library import NOTHING, Clip, MotionLibrary, WindowIndex, opened
from kinespace.library.recordings.formats.labels import Segment
from kinespace.stream import Outcome, Recognition, Settings
from kinespace.tools.cli import arguments
from kinespace.tools.cli.console import counted, note, progress, require_place_for_report
from kinespace.tools.evaluation import harness
from kinespace.tools.evaluation.evaluate_gestures import add_answers, report
from kinespace.tools.evaluation.words import Heard, Span, right_so_far, said_in
from kinespace.tools.feeding.feed import resampled
from kinespace.tools.teaching.lessons import open_taught

#: Frames per second of a show.
_RATE = 60.0
#: Seconds of everyday movement between two gestures, at least; recordings are cut to as much.
_EVERY = 25.0
#: Positions, shape (frames, joints, 3), metres.
Positions = NDArray[np.floating]
#: When a word is right.
_SPANS = {"done": Span(early=0.1, late=1.5), "start": Span(early=0.1, late=1.0)}


class Show(NamedTuple):
    """A performer's examples, and the feed: positions (frames, joints, 3), metres, with the gestures asked in it."""

    performer: str
    examples: Sequence[Clip]
    positions: NDArray[np.float64]
    segments: Sequence[Segment]

    @property
    def gestures(self) -> set[str]:
        """The classes that are taught."""
        return {each.class_name for each in self.examples}

    def heard(self, answers: Sequence[Recognition]) -> Heard:
        """Match what is said with the gestures."""
        ends, starts = ({each: getattr(each, edge) for each in self.segments} for edge in ("end", "start"))
        since, seconds = {"done": ends, "start": starts}, len(self.positions) / _RATE
        so_far, taught = right_so_far(answers, ends), self.gestures
        said = {kind: [each for each in words if each.class_name in taught] for kind, words in said_in(answers).items()}
        return Heard(self.performer, seconds, self.segments, said, _SPANS, since, so_far)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    text = "everyday movement: a folder of recordings, or a table of takes, of which those without any class count"
    parser.add_argument("--movement", type=Path, metavar="FOLDER|TABLE", help=text)
    for option, usual, text in (
        ("--shows", 6, "shows, by the library's persons in turn"),
        ("--gestures", 3, "gestures of a show"),
        ("--examples", 1, "examples that teach each gesture"),
    ):
        parser.add_argument(option, type=arguments.count, default=usual, metavar="N", help=f"{text} (default {usual})")
    text = "beside the built-in library, without the gestures' classes and the performer, as `live --teach`"
    parser.add_argument("--beside", action="store_true", help=text)
    text = "minutes of a show (default %(default)s)"
    parser.add_argument("--minutes", type=arguments.positive, default=10.0, metavar="M", help=text)
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="seed of what is drawn (default %(default)s)")
    arguments.add_reading(parser)
    arguments.add_settings(parser)
    arguments.add_shared(parser, "--json")
    add_answers(parser)


def run(options: argparse.Namespace) -> None:
    """Draw shows, play them, and print how rightly the gestures were said."""
    if options.answers:
        require_place_for_report(options.answers, options)
    settings, everyday, library = arguments.settings_of(options), _everyday(options), MotionLibrary.builtin()
    library = library.restricted_to(harness.shared_joints([library.skeleton, *(each.skeleton for each in everyday)]))
    everyday = [each.over(library.skeleton) for each in everyday]
    if not everyday:
        if options.beside:
            raise ValueError("--beside: expected --movement, because the library's own motions are known there")
        note("everyday movement: the built-in library's motions of other classes; --movement gives other")
    heard, named = list[Heard](), list[bool]()
    for number in progress(range(options.shows), "Playing", options.shows):
        show = drawn(library, everyday, options, number)
        answers = played(show, settings, beside=options.beside)
        heard.append(show.heard(answers))
        named += [each.outcome is Outcome.NAMED and each.class_name in show.gestures for each in answers]
    share = sum(named) / len(named) if named else None
    title = f"{counted(options.gestures, 'gesture')} of one performer among everyday movement"
    when = "delay: from a gesture's end to done, from its beginning to start"
    caption = f"{counted(options.shows, 'show')}; {harness.written(share)} of the time named; {when}"
    report(heard, options, title, caption, named=share, shows=options.shows)


def played(show: Show, settings: Settings, *, beside: bool = False) -> list[Recognition]:
    """Teach a show's examples, in metrics learned without the performer, or beside the built-in library; play it."""
    taught = MotionLibrary.of_clips(show.examples)
    known = _others(taught, show.performer) if beside else None
    index = open_taught(taught, {show.performer}, beside=known)
    positions = show.positions[:, index.library.skeleton.order_from(taught.skeleton.joints)]
    times = np.arange(len(positions)) / _RATE
    return harness.answers_to(harness.Feed(times, positions, index.library.skeleton), index, settings)


def _others(taught: MotionLibrary, performer: str) -> WindowIndex:
    """Open the built-in library's classes that are not taught, of other persons; its metrics know all of them."""
    builtin = opened(MotionLibrary.builtin().restricted_to(taught.skeleton.joints))
    named = [(each.actor, each.class_name) for each in builtin.library.motions]
    others = [place for place, (actor, name) in enumerate(named) if actor != performer and name not in taught.classes]
    return builtin.of_some(others)


def _everyday(options: argparse.Namespace) -> list[Clip]:
    """Read the everyday movement; none where none is given."""
    place: Path | None = options.movement
    if place is None:
        return []
    sources = harness.Sources(tables=[place]) if place.suffix.lower() == ".csv" else harness.Sources(unknown=[place])
    takes = harness.read_takes(sources, arguments.reading_of(options))
    clips = [take.clip for take in takes if [each.label for each in take.segments] == [NOTHING]]
    if not clips:
        raise ValueError(f"--movement: expected a take without classes, got {len(takes)} with classes")
    return clips


def drawn(library: MotionLibrary, everyday: Sequence[Clip], options: argparse.Namespace, number: int) -> Show:
    """Draw a show.

    Parameters
    ----------
    library
        The motions of the performers.
    everyday
        Takes of everyday movement, over the library's skeleton; the library's other classes when there are none.
    options
        The program's options.
    number
        The show's number; the library's persons perform in turn.

    Raises
    ------
    ValueError
        The performer has too few classes of more motions than examples, or no other class is left.
    """
    generator = np.random.default_rng([options.seed, number])
    performer = library.actors[number % len(library.actors)]
    own = defaultdict[str, list["Clip"]](list)
    for motion in library.motions:
        if motion.actor == performer:
            own[motion.class_name].append(motion)
    possible = [name for name, motions in own.items() if len(motions) > options.examples]
    if len(possible) < options.gestures:
        most = f"{len(possible)} (classes of which {performer} has more motions than --examples)"
        raise ValueError(f"--gestures: expected at most {most}, got {options.gestures}")
    examples, asked = list["Clip"](), list["Clip"]()
    gestures = [possible[place] for place in generator.permutation(len(possible))[: options.gestures]]
    for name in gestures:
        order = [own[name][place] for place in generator.permutation(len(own[name])).tolist()]
        examples += order[: options.examples]
        asked += order[options.examples :]
    others = everyday or [motion for motion in library.motions if motion.class_name not in gestures]
    if not others:
        raise ValueError(f"--gestures: expected fewer than all {len(library.classes)} classes without --movement")
    return _laid(performer, examples, _again(asked, generator), _again(others, generator), options.minutes * 60)


def _again(clips: Sequence[Clip], generator: np.random.Generator) -> Iterator[Clip]:
    """Give clips in a drawn order, and when all were given in another, without end."""
    while True:
        yield from (clips[place] for place in generator.permutation(len(clips)).tolist())


def _laid(
    performer: str, examples: Sequence[Clip], asked: Iterator[Clip], others: Iterator[Clip], seconds: float
) -> Show:
    """Put everyday movement on the performer's bones, gestures between, and join them for so many seconds."""
    parents = examples[0].skeleton.parents
    lengths = np.mean([lengths_of(each.positions, parents) for each in examples], axis=0)
    movement = _movement(others, parents, lengths)
    pieces, segments, begin, due = list[Positions](), list[Segment](), 0, _EVERY
    while begin < seconds * _RATE:
        gesture = next(asked) if begin >= due * _RATE else None
        pieces.append(resampled(gesture, _RATE).positions if gesture else next(movement))
        end = begin + len(pieces[-1])
        if gesture:
            segments.append(Segment(begin / _RATE, end / _RATE, gesture.class_name))
            due = (end + _BETWEEN) / _RATE + _EVERY
        begin = end + _BETWEEN
    return Show(performer, examples, joined(pieces, parents.index(-1)), segments)


def _movement(others: Iterator[Clip], parents: Sequence[int], lengths: NDArray[np.float64]) -> Iterator[Positions]:
    """Put recordings on the performer's bones, in pieces that leave room for gestures."""
    most = round(_EVERY * _RATE)
    for each in others:
        laid = on_bones(resampled(each, _RATE).positions, parents, lengths)
        yield from (laid[first : first + most] for first in range(0, len(laid), most))


#: Frames in which one posture becomes the next: 0.4 seconds.
_BETWEEN = round(0.4 * _RATE)


def lengths_of(positions: Positions, parents: Sequence[int]) -> NDArray[np.float64]:
    """Measure a body's segments: the mean distance of each joint from its parent, metres, 0 for the root.

    Parameters
    ----------
    positions
        Shape (frames, joints, 3), metres.
    parents
        The parent of each joint, -1 for the root.
    """
    bones = positions - positions[:, parents]
    bones[:, [parent < 0 for parent in parents]] = 0.0
    lengths: NDArray[np.float64] = np.linalg.norm(bones, axis=2).mean(axis=0)
    return lengths


def on_bones(positions: Positions, parents: Sequence[int], lengths: NDArray[np.float64]) -> NDArray[np.float64]:
    """Put a movement on another body: each segment keeps its direction and gets the body's length.

    The root's way is as much longer as the segments are together.

    Parameters
    ----------
    positions
        Shape (frames, joints, 3), metres.
    parents, lengths
        As in `lengths_of`; the built-in library's parents come before their children.
    """
    laid: NDArray[np.float64] = positions * (lengths.sum() / lengths_of(positions, parents).sum())
    for joint, parent in enumerate(parents):
        if parent >= 0:
            bone = positions[:, joint] - positions[:, parent]
            away = np.maximum(np.linalg.norm(bone, axis=1, keepdims=True), 1e-9)
            laid[:, joint] = laid[:, parent] + lengths[joint] * bone / away
    return laid


def turn(angle: float) -> NDArray[np.float64]:
    """Give the matrix by which rows of positions are turned about the vertical axis, y."""
    sine, cosine = np.sin(angle), np.cos(angle)
    return np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])


def facing(before: Positions, positions: Positions, root: int) -> NDArray[np.float64]:
    """Turn and move a piece about the vertical axis, y, so that it begins where a posture stands, facing as it does.

    Parameters
    ----------
    before
        The posture, shape (joints, 3), metres.
    positions
        The piece, shape (frames, joints, 3), metres.
    root
        The joint that stays where it is; its height is the piece's own.
    """
    (ax, _, az), (bx, _, bz) = (before - before[root]).T, (positions[0] - positions[0, root]).T
    angle = np.arctan2((ax * bz - az * bx).sum(), (ax * bx + az * bz).sum())
    turned = (positions - positions[0, root]) @ turn(-angle)
    moved: NDArray[np.float64] = turned + np.array([before[root, 0], positions[0, root, 1], before[root, 2]])
    return moved


def joined(pieces: Sequence[Positions], root: int) -> NDArray[np.float64]:
    """Join pieces to one walk; in `_BETWEEN` frames one posture becomes the next, slowly first and last.

    Parameters
    ----------
    pieces
        Each of shape (frames, joints, 3), metres.
    root
        As in `facing`.

    Returns
    -------
    The walk, shape (frames, joints, 3), metres.
    """
    share = (np.arange(1, _BETWEEN + 1) / (_BETWEEN + 1))[:, None, None]
    share = share * share * (3 - 2 * share)
    walk = [np.asarray(pieces[0], dtype=np.float64)]
    for piece in pieces[1:]:
        last = walk[-1][-1]
        placed = facing(last, piece, root)
        walk += [last + share * (placed[0] - last), placed]
    return np.concatenate(walk)
