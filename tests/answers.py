"""The answers to nine feeds, kept in `answers.toml`: no change that is not meant to may move them.

After a change that is meant to move them:

    python tests/answers.py --update

Without `--update` it says what differs. `--exact` prints a digest of every bit of every answer, so that two checkouts
can be compared on one machine: another processor rounds otherwise, so these digests are not kept. KINESPACE_COMPILED=0
answers by numpy.
"""

import argparse
import hashlib
import math
import sys
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from fakes import pushed
from numpy.typing import NDArray
from programs import DATA

from kinespace.library import Clip, MotionLibrary, Reading, WindowIndex, compiled, opened, read_recordings
from kinespace.stream import Announcement, Frame, LiveSignature, Performers, Recognition, Recognizer, Settings
from kinespace.tools.feeding.feed import resampled

FILE = Path(__file__).with_name("answers.toml")
#: How far a kept mean may be off: more than another processor's rounding, less than any change of the method.
TOLERANCE = 1e-4
_LEFT_ARM = ("lhumerus", "lradius", "lwrist", "lhand", "lthumb", "lfingers")
#: A body that another program sends: its names of joints of HDM05, of the limbs without their side.
_LIMBS = {"UpperArm": "humerus", "LowerArm": "radius", "Hand": "wrist"}
_LIMBS |= {"UpperLeg": "hipjoint", "LowerLeg": "femur", "Foot": "tibia"}
_SENT = {"Hips": "root", "Spine": "lowerback", "Chest": "thorax", "Neck": "lowerneck", "Head": "head"}
_SENT |= {f"{side}{theirs}": side[0].lower() + ours for side in ("Left", "Right") for theirs, ours in _LIMBS.items()}


@cache
def _asked() -> tuple[MotionLibrary, list[Clip]]:
    """Give the built-in library without a person, and this person's first motion of each class."""
    whole = MotionLibrary.builtin()
    first = {each.class_name: each for each in reversed(whole.motions) if each.actor == "mm"}
    return whole.without(actors=["mm"]), [first[name] for name in sorted(first)]


def frames_of(clips: Iterable[Clip], rate: float, pause: float = 0.2) -> Iterator[Frame]:
    """Show clips one after another, with a pause between them."""
    begin = 1.0
    for clip in clips:
        shown = resampled(clip, rate)
        for place, positions in enumerate(shown.positions):
            yield Frame("ann", begin + place / rate, positions)
        begin += len(shown.positions) / rate + pause


def _motions_at(rate: float, settings: Settings) -> list[Recognition]:
    library, clips = _asked()
    return pushed(Recognizer(library, settings), frames_of(clips, rate))


def _read(data: Path, name: str) -> Clip:
    (clip,) = read_recordings([data / name], Reading(actor_in="name"))
    return clip


def _cmu(data: Path) -> list[Recognition]:
    take = _read(data, "cmu/13_30.amc")
    return pushed(Recognizer(MotionLibrary.builtin(), Settings(progress=True)), frames_of([take], 60.0))


def _strangers(data: Path) -> list[Recognition]:
    take = _read(data, "cmu/86_01.amc")
    shown = replace(take, positions=take.positions[: 25 * 120])
    return pushed(Recognizer(MotionLibrary.builtin(), Settings()), frames_of([shown], 240.0))


def _depth_sensor(data: Path) -> list[Recognition]:
    take = _read(data, "utkinect/joints_s01_e01.txt")
    library = MotionLibrary.builtin().restricted_to(take.skeleton.joints)
    asked = take.restricted_to(library.skeleton.joints).as_of(library.skeleton)
    asked = asked.moved_to(asked.positions[-25 * round(asked.frame_rate) :])
    return pushed(Recognizer(library, Settings(sensitivity=0.4)), frames_of([asked], 30.0))


def _other_names() -> list[Recognition]:
    """Play a sender with fewer joints, of other names, in another order."""
    library, clips = _asked()
    performers, names = Performers(library), tuple(reversed(_SENT))
    places = [library.skeleton.joints.index(_SENT[name]) for name in names]
    performers.announce(Announcement("ann", names), 0.0)
    sent = (replace(frame, positions=frame.positions[places]) for frame in frames_of(clips, 60.0))
    return [answer for frame in sent if (answer := performers.push(frame, frame.time)) is not None]


def _broken() -> list[Recognition]:
    """Play a feed whose joints freeze, are lost, are exchanged, and whose unit changes."""
    library, clips = _asked()
    joints = library.skeleton.joints
    arm, head = [joints.index(name) for name in _LEFT_ARM], joints.index("head")
    other = {"l": "r", "r": "l"}
    mirrored = [
        joints.index(swapped) if (swapped := other.get(name[0], name[0]) + name[1:]) in joints else place
        for place, name in enumerate(joints)
    ]
    seen: dict[str, NDArray[np.float64]] = {}

    def spoilt(frame: Frame) -> Frame:
        positions = frame.positions.copy()
        if 4.0 < frame.time < 9.0:
            positions[arm] = seen.setdefault("arm", positions[arm].copy())
        if 14.0 < frame.time < 15.0:
            positions[head] = math.nan
        if 18.0 < frame.time < 21.0:
            positions = positions[mirrored]
        return replace(frame, positions=1000 * positions if frame.time > 24.0 else positions)

    return pushed(Recognizer(library, Settings()), map(spoilt, frames_of(clips, 60.0)))


@cache
def _known_and_taught() -> tuple[WindowIndex, WindowIndex]:
    library, clips = _asked()
    known = opened(library.without(classes=["squat1Reps", "kickLFront1Reps"]))
    further = [replace(each, actor="ann") for each in clips if each.class_name in ("squat1Reps", "kickLFront1Reps")]
    return known, known.with_motions(further)


def _taught() -> list[Recognition]:
    """Teach two new classes while the feed runs, then take them away; each is shown before, meanwhile and after."""
    named, (known, taught) = {each.class_name: each for each in _asked()[1]}, _known_and_taught()
    shown = [named[name] for name in ("grabHighR", "kickLFront1Reps", "sneak2StepsLStart", "squat1Reps")]
    recognizer, answers = Recognizer(known), list[Recognition]()
    for frame in frames_of(2 * shown, 60.0):
        if len(answers) == 150 and recognizer.library is known.library:
            recognizer.exchange(taught)
        if len(answers) == 400 and recognizer.library is taught.library:
            recognizer.exchange(known)
        answer = recognizer.push(frame)
        answers += [answer] if answer else []
    return answers


#: Each feed's answers, by name; those that need recordings are asked with their folder.
FEEDS: Mapping[str, Callable[[], list[Recognition]]] = {
    "motions_30_hz": lambda: _motions_at(30.0, Settings()),
    "motions_120_hz_with_progress": lambda: _motions_at(120.0, Settings(progress=True)),
    "motions_by_paper": lambda: _motions_at(60.0, Settings(signature=LiveSignature.PAPER)),
    "other_names": _other_names,
    "broken": _broken,
    "taught": _taught,
}
RECORDED: Mapping[str, Callable[[Path], list[Recognition]]] = {
    "cmu_60_hz_with_progress": _cmu,
    "strangers_240_hz": _strangers,
    "depth_sensor_30_hz": _depth_sensor,
}


def summed_up(answers: list[Recognition]) -> dict[str, Any]:
    """Give what any processor agrees on: the words of all answers as a digest, and the means of their numbers."""
    words = hashlib.sha256()
    for each in answers:
        events = [(str(event.kind), event.label, f"{event.time:.4f}") for event in each.events]
        words.update(repr((f"{each.time:.4f}", each.label, each.guess_index, events, each.doubted)).encode())
    phases = [each.progress.phase for each in answers if each.progress]
    return {
        "answers": len(answers),
        "events": sum(len(each.events) for each in answers),
        "words": words.hexdigest()[:16],
        "score": float(np.mean([each.score for each in answers])),
        "eigenvector_score": float(np.mean([each.eigenvector_score for each in answers])),
        "lead": float(np.mean([min(each.lead, 5.0) for each in answers])),
        "phase": float(np.mean(phases)) if phases else 0.0,
    }


def exactly(answers: list[Recognition]) -> str:
    """Give a digest of every bit of every answer."""
    bits = hashlib.sha256()
    for each in answers:
        evidence = tuple(each.evidence) if each.evidence else ()
        numbers = (each.time, each.movement, each.lead, each.eigenvector_score, each.share, each.gap)
        words = (each.label, each.classes, each.guess, each.eigenvector_class, each.events, each.doubted, each.progress)
        bits.update(repr((numbers, words, evidence)).encode())
        bits.update(np.ascontiguousarray(each.scores).tobytes())
    return bits.hexdigest()[:16]


def arithmetic() -> str:
    """Name the arithmetic in use."""
    return "compiled" if compiled.in_use else "plain"


def differing(kept: Mapping[str, Any], got: Mapping[str, Any]) -> list[str]:
    """Say which of a feed's numbers differ from the kept ones."""
    return [
        f"{name}: expected {value}, got {got[name]}"
        for name, value in kept.items()
        if (abs(got[name] - value) > TOLERANCE if isinstance(value, float) else got[name] != value)
    ]


def kept() -> dict[str, Any]:
    """Read the kept answers."""
    return tomllib.loads(FILE.read_text()) if FILE.exists() else {}


def _written(answers: Mapping[str, Any]) -> str:
    lines = ["# Written by `python tests/answers.py --update`."]
    for name in sorted(answers):
        texts = {key: f"{each:.6f}" if isinstance(each, float) else repr(each) for key, each in answers[name].items()}
        lines += ["", f"[{name}]", *(f"{key} = {text}" for key, text in texts.items())]
    return "\n".join(lines).replace("'", '"') + "\n"


def main() -> int:
    """Compare, or keep, or print exact digests."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--update", action="store_true")
    parser.add_argument("--exact", action="store_true")
    parser.add_argument("names", nargs="*")
    options = parser.parse_args()
    before, differs = kept(), False
    for name in options.names or (*FEEDS, *RECORDED):
        answers = FEEDS[name]() if name in FEEDS else RECORDED[name](DATA)
        if options.exact:
            print(name, arithmetic(), exactly(answers))  # noqa: T201 - a script
        got = summed_up(answers)
        changes = differing(before.get(name, {}), got)
        differs |= bool(changes)
        for each in changes:
            print(f"{name}: {each}")  # noqa: T201 - a script
        before[name] = got
    if options.update:
        FILE.write_text(_written(before))
    return 1 if differs and not options.update else 0


if __name__ == "__main__":
    sys.exit(main())
