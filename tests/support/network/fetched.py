"""What tests need from the network, fetched for this user before they run; what cannot be fetched is said.

The tests that need it are then skipped, or fail where none may be skipped.
"""

import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import films

from kinespace.tools.camera import models


def main() -> None:
    """Fetch BlazePose's models and a film of a person, unless they are there."""
    try:
        try:
            models.models_at(None, "full")
        except OSError:
            print("setup: fetching the models of the camera's tests ...", flush=True)  # noqa: T201 - a program
            models.fetched(lambda _: None)
    except OSError as error:
        print(f"setup: {error}")  # noqa: T201 - as above
    try:
        films.fetched_demo(films.demo_film(models.cache()))
    except (subprocess.CalledProcessError, OSError) as error:
        print(f"setup: Sports2D's film could not be fetched: {error}")  # noqa: T201 - as above


if __name__ == "__main__":
    main()
