"""The recognisers of `kinespace live`: the library cut to the feed's joints, and the lessons where people may teach."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from kinespace.library import MotionLibrary
from kinespace.library.naming import Naming
from kinespace.library.windows.index import WindowIndex
from kinespace.stream.feeds import Preset
from kinespace.stream.recognizer import Performers, Recognizer, SentJoints, Settings
from kinespace.stream.service.background_opener import BackgroundViews
from kinespace.tools.cli.arguments import library_at, naming_of, settings_of
from kinespace.tools.cli.presets import joints_in_order
from kinespace.tools.cli.values import meant
from kinespace.tools.teaching.beginning import open_lessons
from kinespace.tools.teaching.lessons import Lessons
from kinespace.tools.terminal.console import say

#: A library, perhaps opened already.
Known = MotionLibrary | WindowIndex

#: In place of a library: only taught motions are known.
_NO_LIBRARY = Path("none")


def _made(options: argparse.Namespace, library: Known, joints: SentJoints, classes: Sequence[str] = ()) -> Performers:
    return Performers(
        library,
        settings_of(options),
        most=options.performers,
        joints=joints,
        views=BackgroundViews(),
        classes=classes,
    )


def recognisers(options: argparse.Namespace, preset: Preset | None) -> tuple[Performers, Lessons | None]:
    """Make the recognisers, and the lessons if people may teach."""
    library, naming = options.library, naming_of(options)
    nothing = library == _NO_LIBRARY
    if nothing and not options.teach:
        raise ValueError("--library none: expected --teach with it")
    if options.joints and preset:
        raise ValueError("--joints: expected no --feed with it; a preset says which joints there are")
    joints = naming.read(joints_in_order(options.joints)).joints if options.joints else ()
    motions = library_at(None if nothing else library)
    if naming.convention or naming.finds:
        motions = motions.in_our_names(Naming())
    if nothing:
        joints = joints or (preset.joints if preset else ())
    elif preset:
        motions = fitted(motions, f"feed {preset.name}", preset.joints)
    elif joints:
        motions = fitted(motions, "--joints", joints)
    sent = SentJoints(joints, naming)
    if options.teach:
        lessons = _lessons(options, None if nothing else motions, sent)
        return lessons.performers, lessons
    _require_room_for(motions, settings_of(options))
    return _made(options, motions, sent), None


def fitted(motions: MotionLibrary, whose: str, joints: Sequence[str]) -> MotionLibrary:
    """Restrict a library to the joints a feed has, and print which.

    Raises
    ------
    SkeletonMismatchError
        Library and feed share fewer than five joints.
    """
    shared = motions.restricted_to(joints)
    if shared is not motions:
        for name in joints:
            near = "" if name in motions.skeleton.joints else meant(name, [*{*motions.skeleton.joints} - {*joints}])
            if near:
                say(f"{whose}: the library has no joint {name!r}{near}")
        further = [name for name in joints if name not in motions.skeleton.joints]
        if further:
            say(f"{whose}: not compared, because the library lacks them: {', '.join(further)}")
        say(f"{whose}: {len(shared.skeleton.joints)} of the library's {len(motions.skeleton.joints)} joints")
    return shared


def _lessons(options: argparse.Namespace, motions: MotionLibrary | None, sent: SentJoints) -> Lessons:
    """Open the taught library."""

    def performers(index: WindowIndex, classes: Sequence[str]) -> Performers:
        covers = set(index.library.skeleton.joints) <= set(sent.assumed)
        joints = replace(sent, assumed=sent.assumed if covers else ())
        _require_room_for(index, settings_of(options))
        return _made(options, index, joints, classes)

    # People before a camera seldom think of their sides.
    either_side = bool(options.camera) if options.either_side is None else options.either_side
    lessons = open_lessons(
        options.teach,
        motions,
        sent.assumed,
        performers,
        options.stillness,
        either_side=either_side,
    )
    lessons.is_loud = options.loud_lessons
    return lessons


def _require_room_for(motions: Known, settings: Settings) -> None:
    """Refuse a window that this machine has no memory for now, not at the first performer's first frame."""
    try:
        Recognizer(motions, settings)
    except MemoryError as error:
        if settings.window is None:
            raise
        raise ValueError(f"--window: expected seconds that memory has room for, got {settings.window:g}") from error
