"""A page in one file, which needs no other file and no net."""

from __future__ import annotations

import base64
from importlib import resources
from typing import TYPE_CHECKING

import msgspec
import numpy as np

if TYPE_CHECKING:
    from pathlib import Path

    from kinespace.library import Clip

_encode = msgspec.json.Encoder().encode
#: Metres from the origin to which bodies are kept: as far as millimetres in 16 bits reach.
_REACH = 32.767


def body_shown(clip: Clip, often: float) -> dict[str, object]:
    """Describe a clip's body for `bodiesIn` and `Stage` in `draw.js`, `often` times a second, in millimetres."""
    step = max(round(clip.frame_rate / often), 1)
    positions = clip.positions[::step].astype(np.float64)
    # A body far from the origin is brought back to it; its way is kept.
    near = (positions - positions[0].mean(axis=0)).clip(-_REACH, _REACH)
    return {
        "names": clip.skeleton.joints,
        "parents": clip.skeleton.parents or (-1,) * len(clip.skeleton.joints),
        "rate": clip.frame_rate / step,
        "bodies": base64.b64encode((near * 1000).round().astype("<i2").tobytes()).decode(),
    }


def write_sheet(path: Path, name: str, title: str, shown: object) -> None:
    """Write a page.

    Parameters
    ----------
    path
        The HTML file.
    name
        Of the page's own files in `static/`: its main part, `NAME.html`, and its script, `NAME.js`.
    title
        What it is called behind "kinespace: ".
    shown
        What the script shows; anything that JSON can hold.

    Raises
    ------
    OSError
        The file cannot be written.
    """
    files = resources.files("kinespace.tools.page") / "static"
    page = (files / "sheet.html").read_text(encoding="utf-8").replace("<!-- title -->", title)
    parts = {"<!-- main -->": f"{name}.html", "/* script */": f"{name}.js"}
    for place, file in (parts | {f"/* {each} */": each for each in ("page.css", "draw.js")}).items():
        page = page.replace(place, (files / file).read_text(encoding="utf-8"))
    # A name that holds </script> must not end the script.
    path.write_text(page.replace("/* shown */", _encode(shown).decode().replace("<", "\\u003c")), encoding="utf-8")
