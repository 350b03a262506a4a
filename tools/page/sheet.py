"""A page in one file, which needs no other file and no net."""

from __future__ import annotations

from importlib import resources
from typing import TYPE_CHECKING

import msgspec

if TYPE_CHECKING:
    from pathlib import Path

_encode = msgspec.json.Encoder().encode


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
