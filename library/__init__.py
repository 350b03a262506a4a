"""Motions at rest: skeletons, recordings, distances, signatures, the motion library and retrieval."""

from library.clip import Clip
from library.distances import distance_rows
from library.motionlibrary import NOTHING, MotionLibrary
from library.recordings import Reading, find_recordings, read_recordings
from library.signature import signature_of, similarity
from library.skeleton import Skeleton, SkeletonMismatchError

__all__ = [
    "NOTHING",
    "Clip",
    "MotionLibrary",
    "Reading",
    "Skeleton",
    "SkeletonMismatchError",
    "distance_rows",
    "find_recordings",
    "read_recordings",
    "signature_of",
    "similarity",
]
