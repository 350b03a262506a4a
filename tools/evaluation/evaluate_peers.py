"""`kinespace evaluate peers`: whole motions named by kinespace, and by what a researcher would otherwise take.

Every person in turn is left out and asks; the others' motions teach. The peers are MiniRocket, time warping, the
tangent space of covariances and support vectors, each by its library's defaults (the extra `peers`).

kinespace takes motions as they are, and learns them whole, whatever share of a motion asks. The peers get motions with
the hips in the middle, turned to face one way in the first frame, of one size and one number of frames, and learn
motions cut at the same share as the motions that ask.
"""

import argparse
import time
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinespace.library import Clip
from kinespace.library.signature.own_frame import at_steps, corners_of, own_path
from kinespace.library.windows.comparison import FIRST_WINDOW
from kinespace.stream import MotionClassifier
from kinespace.stream.outputs.sink import extra
from kinespace.tools.cli.console import counted, progress, scores_of, tell
from kinespace.tools.evaluation.evaluate_show import turn
from kinespace.tools.evaluation.harness import add_sources, motions_at

#: Shares of a motion that are seen.
_SHARES = 0.25, 0.5, 0.75, 1.0
#: Frames of a motion as peers see it; the slower peers see fewer.
_FRAMES, _FEW = 64, 32
_COLUMNS = " | ".join(
    (
        "method {method}",
        *(f"{share:.0%} seen {{seen[{place}]:.1%}}" for place, share in enumerate(_SHARES)),
        "turned {turned:.1%} | fit, s {fit_s:.1f} | ms a clip {clip_ms:.1f}",
    )
)


class Method(NamedTuple):
    """A method: makes a classifier by scikit-learn's conventions, and gives clips as it takes them.

    Attributes
    ----------
    make
        Makes the classifier.
    seen
        Gives clips as the classifier takes them.
    learns_whole
        Whether it learns whole motions, even where parts of motions ask.
    """

    make: Callable[[], Any]
    seen: Callable[[Sequence[Clip]], Any]
    learns_whole: bool = False


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    add_sources(parser, "the built-in library's motions")
    parser.add_argument("--alone", action="store_true", help="without the peers, which need the extra `peers`")


def run(options: argparse.Namespace) -> None:
    """Let each method learn and be asked, person by person, and print how often it is right."""
    clips = motions_at(options)
    persons = sorted({clip.actor for clip in clips})
    if len(persons) < 2 or "" in persons:
        named = ", ".join(filter(None, persons)) or "none"
        raise ValueError(f"TAKE: expected motions of two persons or more, got {named}; --actor-in says where they are")
    methods = {"kinespace": Method(MotionClassifier, list, learns_whole=True)} | ({} if options.alone else _peers())
    compared = progress([*methods], "Comparing", len(methods))
    rows = [{"method": name, **_scored(methods[name], clips, persons)} for name in compared]
    whose = f"{counted(len(clips), 'motion')} of {len({clip.class_name for clip in clips})} classes"
    caption = f"{whose}; each of {len(persons)} persons left out; turned: whole, each body turned and placed at random"
    found = {"motions": len(clips), "persons": len(persons), "shares": _SHARES, "methods": rows}
    tell(options, found, scores_of(rows, _COLUMNS, title="Of how many motions is the class right?", caption=caption))


def _peers() -> dict[str, Method]:
    """Give the peers, as their libraries make them."""
    rocket = extra("aeon.classification.convolution_based", "peers").MiniRocketClassifier
    nearest = extra("aeon.classification.distance_based", "peers").KNeighborsTimeSeriesClassifier
    covariances = extra("pyriemann.estimation", "peers").Covariances
    tangent = extra("pyriemann.tangentspace", "peers").TangentSpace
    logistic = extra("sklearn.linear_model", "peers").LogisticRegression
    in_a_row = extra("sklearn.pipeline", "peers").make_pipeline
    vectors = extra("sklearn.svm", "peers").SVC
    return {
        "MiniRocket": Method(lambda: rocket(random_state=0), lambda clips: _even(clips, _FRAMES)),
        "time warping": Method(
            lambda: nearest(distance="dtw", distance_params={"window": 0.1}), lambda clips: _even(clips, _FEW)
        ),
        "tangent space": Method(
            lambda: in_a_row(covariances("oas"), tangent(), logistic(max_iter=1000)),
            lambda clips: _even(clips, _FRAMES),
        ),
        "support vectors": Method(vectors, lambda clips: _even(clips, _FEW).reshape(len(clips), -1)),
    }


def _even(clips: Sequence[Clip], frames: int) -> NDArray[np.float64]:
    """Give clips of one number of frames, in the body's own place, heading and size: (clips, coordinates, frames)."""
    return np.array([_upright(clip, frames).reshape(frames, -1).T for clip in clips])


def _upright(clip: Clip, frames: int) -> NDArray[np.float64]:
    positions = at_steps(clip.times, clip.positions, np.linspace(0.0, clip.times[-1], frames))
    corners = corners_of(clip.skeleton)
    if corners is None:
        raise ValueError(f"{clip.name}: expected shoulders and hips, by which the peers' bodies are turned")
    left_shoulder, right_shoulder, left_hip, right_hip = positions[0, corners]
    across = left_shoulder - right_shoulder + left_hip - right_hip
    middle = positions[:, corners[2:]].mean(axis=1, keepdims=True)
    own: NDArray[np.float64] = (positions - middle) @ turn(-np.arctan2(across[2], across[0]))
    return own / own_path(positions, clip.skeleton)[1]


def _elsewhere(clip: Clip, draw: np.random.Generator) -> Clip:
    """Turn a body and place it elsewhere, within two metres."""
    turned = clip.positions @ turn(draw.uniform(0, 2 * np.pi)) + draw.uniform(-2, 2, 3) * (1, 0, 1)
    return replace(clip, positions=turned)


def _begun(clip: Clip, share: float) -> Clip:
    """Give the first part of a motion, long enough for a window."""
    least = int(FIRST_WINDOW * clip.frame_rate) + 2
    return replace(clip, positions=clip.positions[: max(least, round(share * clip.frames))], gaps=())


def _scored(method: Method, clips: Sequence[Clip], persons: Sequence[str]) -> dict[str, Any]:
    """Give one method's figures over all persons; seconds are the processor's, of whole motions."""
    right = defaultdict[object, list[bool]](list)
    seconds = np.zeros(2)
    for person in persons:
        asking = [clip for clip in clips if clip.actor == person]
        teaching = [clip for clip in clips if clip.actor != person]
        began = time.process_time()
        whole = _taught(method, teaching)
        # The first question opens a library, and compiles the peers' loops.
        _right(whole, method, asking[:1])
        learned = time.process_time()
        right[1.0] += _right(whole, method, asking)
        seconds += learned - began, time.process_time() - learned
        for share in _SHARES[:-1]:
            classifier = whole if method.learns_whole else _taught(method, [_begun(clip, share) for clip in teaching])
            right[share] += _right(classifier, method, [_begun(clip, share) for clip in asking])
        draw = np.random.default_rng(0)
        right["turned"] += _right(whole, method, [_elsewhere(clip, draw) for clip in asking])
    means = {seen: float(np.mean(each)) for seen, each in right.items()}
    return {
        "seen": [means[share] for share in _SHARES],
        "turned": means["turned"],
        "fit_s": seconds.item(0) / len(persons),
        "clip_ms": 1000 * seconds.item(1) / len(clips),
    }


def _taught(method: Method, clips: Sequence[Clip]) -> Any:  # noqa: ANN401 - a classifier of any library
    return method.make().fit(method.seen(clips), np.array([clip.class_name for clip in clips]))


def _right(classifier: Any, method: Method, clips: Sequence[Clip]) -> list[bool]:  # noqa: ANN401 - as above
    named: list[str] = classifier.predict(method.seen(clips)).tolist()
    return [name == clip.class_name for name, clip in zip(named, clips, strict=True)]
