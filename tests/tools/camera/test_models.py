import hashlib
import subprocess
import sys
import zipfile
from collections.abc import Sequence
from pathlib import Path

import pytest

from kinespace.tools.camera import models
from kinespace.tools.cli.main import main

_DETECTOR, _FULL = "pose_detection.tflite", "pose_landmark_full.tflite"


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Give this user another cache, and small files in place of the models."""
    for variable in ("XDG_CACHE_HOME", "LOCALAPPDATA", "HOME"):
        monkeypatch.setenv(variable, str(tmp_path / "home"))
    known = {hashlib.sha256(content).hexdigest(): name for name, content in _files().items()}
    monkeypatch.setattr(models, "_KNOWN", known)
    return models.cache()


def _files() -> dict[str, bytes]:
    return {_DETECTOR: b"detector", _FULL: b"landmarks"}


def _packs(folder: Path, contents: Sequence[bytes]) -> None:
    with zipfile.ZipFile(folder / "mediapipe.whl", "w") as wheel:
        for number, content in enumerate(contents):
            wheel.writestr(f"mediapipe/{number}.tflite", content)


def test_models_are_fetched_checked_kept_and_read(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without npm pip fetches the wheel; the line names the folder, the files, the source and the licence."""
    monkeypatch.setattr("shutil.which", lambda _: None)
    commands: list[Sequence[str]] = []

    def run(command: Sequence[str], *, cwd: Path, **_: object) -> None:
        commands.append(command)
        _packs(cwd, [b"other", *_files().values()])

    monkeypatch.setattr(subprocess, "run", run)
    said: list[str] = []
    assert models.fetched(said.append) == place
    assert commands[0][:4] == [sys.executable, "-m", "pip", "download"]
    assert commands[0][-1] == "mediapipe==0.10.21"
    assert said == [f"{place}: {_DETECTOR}, {_FULL}; from mediapipe==0.10.21 (pip), {models.LICENCE}"]
    assert models.models_at(None, "full") == models.Models(b"detector", b"landmarks")
    (place / _FULL).write_bytes(b"changed")
    with pytest.raises(ValueError, match=r"pose_landmark_full.tflite: damaged; `kinespace camera --get-models`"):
        models.models_at(None, "full")


def test_clients_that_fail_are_named(
    place: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """One line says why each failed, and what else can be done."""
    monkeypatch.setattr("shutil.which", lambda _: "npm")

    def run(command: Sequence[str], **_: object) -> None:
        raise subprocess.CalledProcessError(1, command, stderr=f"much\n{Path(command[0]).name[:3]} is offline\n")

    monkeypatch.setattr(subprocess, "run", run)
    assert main(["camera", "--get-models"]) == 2
    said = capsys.readouterr().err
    assert said.startswith("kinespace: models: not fetched (npm: npm is offline; pip: pyt is offline); --models takes")
    assert said.count("\n") == 1
    assert not place.exists()


@pytest.mark.slow
def test_the_packages_models_have_the_known_contents(camera_models: Path) -> None:
    """What npm or pip brings is what is checked for."""
    assert (camera_models / _DETECTOR).stat().st_size > 2_900_000
    assert len(models.models_at(None, "full").landmarks) == 6_440_512
