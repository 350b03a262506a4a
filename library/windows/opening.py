"""Libraries opened for recognition, by all their joints or by fewer; what is remembered is not computed again."""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

from threadpoolctl import threadpool_limits

from kinespace.library.memory import give_back_memory
from kinespace.library.motion_library import MotionLibrary
from kinespace.library.windows.comparison import Weighing
from kinespace.library.windows.index import WindowIndex
from kinespace.library.windows.remembered import Numbers, remembered
from kinespace.library.windows.taught import usual_weighing

#: Threads of linear algebra: the matrices are small, and threads take the cores from each other. On two busy cores,
#: opening takes 2 to 7 seconds by numpy's own choice of threads, and .7 by one.
_THREADS = 1
#: Views by fewer joints that an index keeps.
MAX_VIEWS = 8


@lru_cache(maxsize=4)
def opened(library: MotionLibrary, weighing: Weighing | None = None) -> WindowIndex:
    """Give a library's windows; several recognisers of one library share them."""
    with threadpool_limits(_THREADS):
        index = _opened(library, weighing or usual_weighing(library)).prepared()
    give_back_memory()
    return index


def by_joints(index: WindowIndex, joints: Sequence[str]) -> WindowIndex:
    """Give an index as a body of some of its joints shows it; takes a second where the library is large.

    The view's motions keep no frames, only their classes and persons. The last `MAX_VIEWS` views are kept.

    Raises
    ------
    ValueError
        No motion is long enough for a window.
    SkeletonMismatchError
        Fewer than five of the joints are the library's.
    """
    whole, key = index.whole or index, tuple(joints)
    view = whole.views.get(key)
    if view is None:
        while len(whole.views) >= MAX_VIEWS:
            whole.views.pop(next(iter(whole.views)), None)
        with threadpool_limits(_THREADS):
            view = whole.views[key] = _viewed(whole, key).prepared()
        give_back_memory()
    return view


def has_view(index: WindowIndex, joints: tuple[str, ...]) -> bool:
    """Whether `by_joints` has these windows open."""
    return joints in (index.whole or index).views


def _viewed(whole: WindowIndex, joints: tuple[str, ...]) -> WindowIndex:
    if whole.base is None:
        view = _opened(whole.library, whole.comparison.weighing, joints)
    else:
        # The base's view serves other indices, too.
        base, before = by_joints(whole.base, joints), whole.base.library.motions
        shown = {id(motion): fewer for motion, fewer in zip(before, base.library.motions, strict=True)}
        motions = tuple(shown.get(id(each)) or each.restricted_to(joints) for each in whole.library.motions)
        view = base.of_library(replace(base.library, motions=motions), whole.every)
        view.library = _bare(view.library)
        if whole.rejection is whole.base.rejection:
            view.rejection = base.rejection
    view.whole = whole
    return view


def _opened(library: MotionLibrary, weighing: Weighing, joints: tuple[str, ...] = ()) -> WindowIndex:
    """Open a library's windows, perhaps by some joints, with all that need not be computed again."""

    def compute() -> Numbers:
        index = WindowIndex.of(library.restricted_to(joints) if joints else library, weighing=weighing)
        learned = index.body, index.basis, index.comparison
        placed = index.vectors, index.eigenvectors, index.motions, index.head
        return *learned, *placed, index.rejection, index.segments, index.courses

    numbers = remembered(library, weighing, joints, compute)
    index = WindowIndex(_bare(library).restricted_to(joints) if joints else library, *numbers[:7])
    index.rejection, index.segments, index.courses = numbers[7:]
    return index


def _bare(library: MotionLibrary) -> MotionLibrary:
    """Give a library whose motions keep two frames each."""
    bare = (replace(clip, positions=clip.positions[:2].copy()) for clip in library.motions)
    return replace(library, motions=tuple(bare))
