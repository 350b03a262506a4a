"""The recognisers of `kinespace live`: the library cut to the feed's joints, and the desk where people may teach."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from kinespace.library.naming import Naming
from kinespace.stream.recognizer import Performers, Recognizer, SentJoints
from kinespace.stream.service.background_opener import background_restricter, background_windows
from kinespace.stream.service.recognising import Teachable
from kinespace.tools.cli.arguments import library_at
from kinespace.tools.cli.choice import meant
from kinespace.tools.feeding.joint_sets import joints_in_order
from kinespace.tools.teaching.desk import Start, open_desk
from kinespace.tools.terminal.console import console

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from kinespace.library import MotionLibrary
    from kinespace.library.windows.index import WindowIndex
    from kinespace.stream.feeds import Preset
    from kinespace.stream.outputs import Sink
    from kinespace.stream.recognizer import Settings
    from kinespace.stream.recognizer.joints.fewer_joints import Restricter
    from kinespace.stream.service.loop import Source
    from kinespace.stream.service.recognising import Recognising
    from kinespace.tools.programs.live.options import Feed, Teaching
    from kinespace.tools.teaching.desk import Desk

#: In place of a library: only taught motions are known.
_NO_LIBRARY = Path("none")


class Making(Protocol):
    """Makes the recognisers of a service, in this process or elsewhere; parameters as for `Performers`."""

    def __call__(
        self,
        library: MotionLibrary | WindowIndex,
        settings: Settings,
        *,
        most: int,
        joints: SentJoints,
        classes: Sequence[str] = (),
    ) -> Recognising:
        """Make them."""


def in_this_process(
    library: MotionLibrary | WindowIndex,
    settings: Settings,
    *,
    most: int,
    joints: SentJoints,
    classes: Sequence[str] = (),
) -> Performers:
    """Make recognisers that the service's own loop calls."""
    return Performers(library, settings, most=most, joints=joints, opener=background_windows(), classes=classes)


@dataclass(slots=True)
class Where:
    """Where performers are recognised: in this process, unless `make` makes recognisers elsewhere.

    Attributes
    ----------
    make
        Makes the recognisers; it appends to `sources` and `sinks`.
    sources, sinks
        Where their answers come back, and further sinks.
    """

    make: Making = in_this_process
    sources: list[Source] = field(default_factory=list)
    sinks: list[Sink] = field(default_factory=list)

    def close(self) -> None:
        """Close the sources, also when the service that would have done so was never made."""
        for each in self.sources:
            each.close()


def recognisers(
    library: Path | None,
    preset: Preset | None,
    feed: Feed,
    *,
    teaching: Teaching,
    settings: Settings,
    most: int,
    make: Making = in_this_process,
) -> tuple[Recognising, Desk | None]:
    """Make the recognisers, and the desk in front of them if people may teach."""
    nothing = library == _NO_LIBRARY
    if nothing and not teaching.file:
        raise ValueError("--library none: expected --teach with it")
    joints = _assumed_joints(feed)
    motions = library_at(None if nothing else library)
    if feed.naming.convention or feed.naming.finds:
        motions = motions.in_our_names(Naming())
    if nothing:
        joints = joints or (preset.joints if preset else ())
    elif preset:
        motions = fitted(motions, f"feed {preset.name}", preset.joints)
    elif joints:
        motions = fitted(motions, "--joints", joints)
    sent = SentJoints(joints, feed.naming, background_restricter(settings))
    if teaching.file:
        desk = _desk(
            teaching, None if nothing else motions, sent, settings, partial(make, settings=settings, most=most)
        )
        return desk, desk
    _require_room_for(motions, settings)
    return make(motions, settings, most=most, joints=sent), None


def _assumed_joints(feed: Feed) -> tuple[str, ...]:
    if feed.joints and feed.preset:
        raise ValueError("--joints: expected no --feed with it; a preset says which joints there are")
    return feed.naming.read(joints_in_order(feed.joints)).joints if feed.joints else ()


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
            told = "" if name in motions.skeleton.joints else meant(name, [*{*motions.skeleton.joints} - {*joints}])
            if told:
                console.print(f"{whose}: the library has no joint {name!r}{told}", soft_wrap=True)
        further = [name for name in joints if name not in motions.skeleton.joints]
        if further:
            console.print(
                f"{whose}: not compared, because the library lacks them: {', '.join(further)}", soft_wrap=True
            )
        console.print(
            f"{whose}: {len(shared.skeleton.joints)} of the library's {len(motions.skeleton.joints)} joints",
            soft_wrap=True,
        )
    return shared


def _desk(
    teaching: Teaching,
    motions: MotionLibrary | None,
    sent: SentJoints,
    settings: Settings,
    make: Callable[..., Recognising],
) -> Desk:
    """Open the taught library."""
    assert teaching.file is not None  # noqa: S101 - for mypy

    def performers(index: WindowIndex, classes: Sequence[str], restrict: Restricter) -> Teachable:
        covers = set(index.library.skeleton.joints) <= set(sent.assumed)
        joints = replace(
            sent, assumed=sent.assumed if covers else (), restricter=background_restricter(settings, restrict)
        )
        _require_room_for(index, settings)
        made = make(index, joints=joints, classes=classes)
        if not isinstance(made, Teachable):
            raise ValueError(f"--teach: expected recognisers that take another library, got {type(made).__name__}")  # noqa: TRY004 - the program's options are at fault
        return made

    return open_desk(Start(teaching.file, motions, sent.assumed), performers)


def _require_room_for(motions: MotionLibrary | WindowIndex, settings: Settings) -> None:
    """Refuse a window that this machine has no memory for now, not at the first performer's first frame."""
    try:
        Recognizer(motions, settings)
    except MemoryError as error:
        if settings.window is None:
            raise
        raise ValueError(f"--window: expected seconds that memory has room for, got {settings.window:g}") from error
