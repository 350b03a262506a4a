"""OSCQuery's description of our OSC addresses: pure functions from what is known to JSON objects.

As the OSCQuery proposal (Vidvox, 2018) has it: a tree of nodes by address, each with FULL_PATH, DESCRIPTION, and, if a
message has that address, TYPE (OSC's type tags), ACCESS (1: we send it, 2: we take it) and RANGE (for each argument MIN
and MAX, or VALS).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple
from urllib.parse import unquote

from kinespace.stream.osc import SKELETON, address_part
from kinespace.stream.recognition import GONE, EventKind, Outcome
from kinespace.stream.teaching.wire import TEACH

_Node = dict[str, Any]
#: The attributes that we give; a client may ask for one alone.
_ATTRIBUTES = ("FULL_PATH", "CONTENTS", "TYPE", "ACCESS", "RANGE", "DESCRIPTION")
_SENT, _TAKEN = 1, 2
#: Any value.
_ANY = None
_SHARE = {"MIN": 0.0, "MAX": 1.0}


class Known(NamedTuple):
    """What is described.

    Attributes
    ----------
    joints
        The number of joints in a frame that names none.
    classes
        The classes, in the order of their indices.
    performers
        The performers who are followed now.
    teaches
        Whether people may teach.
    """

    joints: int
    classes: Sequence[str]
    performers: Sequence[str] = ()
    teaches: bool = False


def described(known: Known) -> _Node:
    """Give the root of the tree."""
    count = len(known.classes)
    index, names = {"MIN": -1, "MAX": count - 1}, {"VALS": [*known.classes]}
    labels = {"VALS": [*known.classes, *(str(each) for each in Outcome if each is not Outcome.NAMED), GONE]}
    root: _Node = {"FULL_PATH": "/", "CONTENTS": {}, "ACCESS": 0, "DESCRIPTION": "kinespace names movements"}

    def add(address: str, types: str, access: int, text: str, *ranges: _Node | None) -> None:
        node = root
        for part in address[1:].split("/"):
            path = f"{node['FULL_PATH'].rstrip('/')}/{part}"
            node = node.setdefault("CONTENTS", {}).setdefault(part, {"FULL_PATH": path, "ACCESS": 0})
        node |= {"TYPE": types, "ACCESS": access, "DESCRIPTION": text}
        node |= {"RANGE": [*ranges]} if ranges else {}

    text = "performer, time in seconds or 0, x y z of each joint, metres"
    add("/motion/frame", "sd" + "fff" * known.joints, _TAKEN, text)
    add(SKELETON, "s" + "s" * known.joints, _TAKEN, "performer, name of each joint, in the order of the frames")
    if known.teaches:
        add(TEACH, "ss", _TAKEN, "performer, class: teaches a motion", _ANY, _ANY)
    add("/motion/classes", "s" * count, _SENT, "the classes, in the order of their indices", *[names] * count)
    add("/motion/status", "ifii", _SENT, "alive, frames a second, performers, lost")
    for name in known.performers:
        at = f"/motion/{address_part(name)}"
        add(f"{at}/class", "iff", _SENT, "index (-1: none), score, margin", index, _SHARE, {"MIN": -1.0, "MAX": 1.0})
        add(f"{at}/guess", "i", _SENT, "index of the best guess", index)
        add(f"{at}/sofar", "i", _SENT, "index of the class that the last seconds are nearest to", index)
        add(f"{at}/label", "s", _SENT, "class, or why none is named", labels)
        add(f"{at}/scores", "f" * count, _SENT, "score of each class", *[_SHARE] * count)
        event: list[_Node | None] = [{"VALS": [str(each) for each in EventKind]}, names, index, _SHARE, _ANY]
        add(f"{at}/event", "ssiff", _SENT, "start or end, class, index, score, time", *event)
        text = "class, index, count, start, duration, score, speed, amplitude"
        add(f"{at}/done", "siifffff", _SENT, text, names, index)
    return root


def host_info(name: str, host: str, port: int) -> _Node:
    """Give OSCQuery's HOST_INFO: where OSC comes in, and which attributes there are."""
    extensions = dict.fromkeys(("ACCESS", "RANGE", "DESCRIPTION", "TYPE"), True) | {"VALUE": False, "LISTEN": False}
    return {"NAME": name, "OSC_IP": host, "OSC_PORT": port, "OSC_TRANSPORT": "UDP", "EXTENSIONS": extensions}


def reply(root: _Node, info: _Node, target: str) -> tuple[int, _Node | None]:
    """Answer a GET: the status of HTTP and the object; 404 for no node, 204 for an attribute that a node lacks.

    Parameters
    ----------
    root, info
        As `described` and `host_info` give them.
    target
        The path with its query: an OSC address, and perhaps an attribute or HOST_INFO.
    """
    path, _, query = target.partition("?")
    if query == "HOST_INFO":
        return 200, info
    node: _Node | None = root
    for part in filter(None, path.split("/")):
        below = (node or {}).get("CONTENTS", {})
        # A name in an address may be written as in a URL already.
        node = below.get(part, below.get(unquote(part)))
    if node is None:
        return 404, None
    if not query:
        return 200, node
    if query not in _ATTRIBUTES:
        return 400, None
    return (200, {query: node[query]}) if query in node else (204, None)
