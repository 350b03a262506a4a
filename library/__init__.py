"""Motions at rest: skeletons, recordings, distances, signatures, windows and the motion library."""

from kinespace.library.clip import Clip
from kinespace.library.distances import distance_rows
from kinespace.library.library_file import LibraryFileError
from kinespace.library.motion_library import NOTHING, MotionLibrary
from kinespace.library.recordings import Reading, clips_of, find_recordings, read_recordings
from kinespace.library.skeleton import Skeleton, SkeletonMismatchError
from kinespace.library.windows.index import WindowIndex
from kinespace.library.windows.opening import by_joints, opened
from kinespace.library.windows.paper import signature_of, similarity

__all__ = [
    "NOTHING",
    "Clip",
    "LibraryFileError",
    "MotionLibrary",
    "Reading",
    "Skeleton",
    "SkeletonMismatchError",
    "WindowIndex",
    "by_joints",
    "clips_of",
    "distance_rows",
    "find_recordings",
    "opened",
    "read_recordings",
    "signature_of",
    "similarity",
]
