"""The options of `kinespace live`, as typed, in groups: addresses, the feed, its senders, teaching."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from kinespace.library.naming import Naming
from kinespace.stream.inputs.recording.session import RecordingSession
from kinespace.stream.recognizer import LiveSignature

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from kinespace.stream.feeds import Preset
    from kinespace.stream.inputs import Source
    from kinespace.stream.recognizer import Settings
    from kinespace.stream.zeromq import Keyring


@dataclass(frozen=True, slots=True)
class Addresses:
    """Addresses of frames and answers, as typed; None for none."""

    osc_in: str | None = None
    osc_out: str | None = None
    zmq_in: str | None = None
    zmq_out: str | None = None


@dataclass(frozen=True, slots=True)
class Feed:
    """Another product's feed, as typed, and the layouts of the answers.

    Attributes
    ----------
    preset
        Name or file of a preset; None for our own messages.
    sender
        Host that gets the messages of presets that have any.
    outs
        NAME or NAME=HOST:PORT of layouts; the host `sender` is each performer's own sender.
    joints
        The joints of our own messages' frames when the sender does not name them, as read by
        `tools.feeding.joint_sets.joints_in_order`; None for the library's joints.
    naming
        How announced joint names of our own messages are read.
    """

    preset: str | None = None
    sender: str = "127.0.0.1"
    outs: Sequence[str] = ()
    joints: str | None = None
    naming: Naming = field(default_factory=Naming)


@dataclass(frozen=True, slots=True)
class Guard:
    """The senders that are let in, as typed.

    Attributes
    ----------
    performers
        Names that are allowed; empty for all.
    networks
        Addresses or networks, like 192.168.0.0/24, whose packets are read; empty for all.
    merge
        Let several senders send frames of one performer.
    keyring
        Keys of the peers that are let in by ZeroMQ; None for no keys.
    """

    performers: Sequence[str] = ()
    networks: Sequence[str] = ()
    merge: bool = False
    keyring: Keyring | None = None


@dataclass(frozen=True, slots=True)
class Teaching:
    """Whether people may teach, and by which ways, as typed.

    Attributes
    ----------
    file
        The file for taught motions; None: teaching is off.
    controls
        Further ways in: `wekinator`, `wekinator=HOST:PORT`, or the ZeroMQ endpoint of a socket that replies.
    """

    file: Path | None = None
    controls: Sequence[str] = ()

    def require_file(self, settings: Settings) -> None:
        """Refuse options that need a file, and settings that cannot be taught; ValueError."""
        if self.file is None and self.controls:
            raise ValueError("--control: expected --teach with it")
        if self.file and settings.signature is LiveSignature.PAPER:
            raise ValueError("--teach: expected --signature windows with it, got paper")


@dataclass(frozen=True, slots=True)
class Watched:
    """Who sees the bodies, as typed.

    Attributes
    ----------
    page
        HOST:PORT of our own page in the browser; None for none.
    bodies
        Whether bodies are published beside the ZeroMQ answers.
    recordings
        The folder in which the page begins recordings, and from which it plays them; None for none.
    keys
        The folder of the keys of all ZeroMQ; None for none.
    """

    page: str | None = None
    bodies: bool = False
    recordings: Path | None = None
    keys: Path | None = None

    def require_folder(self, record: Path | None) -> None:
        """Refuse recordings without a page, or beside a recording from the beginning; make their folder."""
        if self.recordings is None:
            return
        if not self.page or record:
            raise ValueError("--recordings: expected --page with it, and no --record")
        self.recordings.mkdir(parents=True, exist_ok=True)

    def session(self, sources: Sequence[Source], preset: Preset | None) -> RecordingSession | None:
        """Give the session that begins and ends recordings; None without a folder for them."""
        return RecordingSession(self.recordings, sources, preset) if self.recordings else None
