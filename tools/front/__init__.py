"""kinespace names the movement a performer is doing, live, from the positions of the body's joints.

Motions at rest
    MotionLibrary    named motions; `MotionLibrary.builtin()`, `.load(file)`, `.of_clips(clips)`, `.save(file)`
    read_recordings  files or a folder of them into clips: BVH, AMC, C3D, TRC, CSV, npz
    clips_of         a take cut into clips by its labels
    Clip, Skeleton   one recording: positions (frames, joints, 3) in metres, and the names of its joints
    distance_rows    a recording's joint-to-joint distances
    opened           a library's windows, computed once for many recognisers

A motion in flight
    Recognizer       one performer: `push(Frame(...))` gives a `Recognition`, or None between two answers
    Performers       several performers, each with joints by any known names
    Frame            one performer's joints at a time in seconds
    Announcement     the names of the joints in a performer's frames
    Settings         how to recognise
    recognise        a whole clip through the live recogniser
    MotionClassifier fit, predict and score of whole clips, as scikit-learn has them

    from kinespace import Frame, MotionLibrary, Recognizer

    library = MotionLibrary.builtin()
    recognizer, motion = Recognizer(library), library.motions[0]
    for time, positions in zip(motion.times, motion.positions):
        if answer := recognizer.push(Frame("me", time, positions)):
            print(answer.time, answer.label, answer.score)

`kinespace.library` and `kinespace.stream` hold all of it; `python -m kinespace --help` lists the programs.
"""

_ROOMS = ("library", "stream")


def __getattr__(name: str) -> object:
    """Import what is asked for; the programs start sooner without."""
    from importlib import import_module, metadata  # noqa: PLC0415 - as the docstring says

    if name in _ROOMS:
        return import_module(f"kinespace.{name}")
    if name == "__version__":
        try:
            return metadata.version("kinespace")
        except metadata.PackageNotFoundError:
            return "unknown"
    for room in () if name.startswith("_") else map(__getattr__, _ROOMS):
        if name in room.__all__:  # type: ignore[attr-defined]  # a module
            return getattr(room, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    """List what can be imported, too."""
    return sorted({*globals(), "__version__"}.union(_ROOMS, *(__getattr__(room).__all__ for room in _ROOMS)))  # type: ignore[attr-defined]
