"""The motion library: motions put together, numbers learned from people, and the file that keeps both."""

from kinespace.library.motion_library.motion_library import MIN_JOINTS, NOTHING, MotionLibrary
