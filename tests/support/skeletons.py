"""The skeletons of `skeletons.toml`: names of joints in other programs."""

import tomllib
from pathlib import Path

KNOWN = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))


def names_of(skeleton: str) -> tuple[str, ...]:
    """Give the names of a skeleton's joints."""
    return tuple(KNOWN[skeleton]["names"])
