"""The leading axis of a sliding window, from whichever matrix costs less: pairs by pairs, or frames by frames.

With rows centred, X of shape (frames, pairs), the covariance XᵀX / (frames - 1) and the Gram matrix XXᵀ have the same
eigenvalues but for that factor, and u of the one gives v = Xᵀu / ‖Xᵀu‖ of the other. Keeping the covariance costs the
square of the pairs and keeping the Gram matrix the pairs times the frames, so that a short window's axis costs in
proportion to the pairs.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from library.eigen import LeadingAxis, leading_axis, leading_axis_from
from library.signature import body_size_of
from stream.covariance import RollingCovariance
from stream.gram import RollingGram

if TYPE_CHECKING:
    from stream.gram import CentredGram
    from stream.rolling import Rows

#: Frames in a window, per pair, up to which the Gram matrix is used, and above which the covariance. Measured at 105 to
#: 1485 pairs they cost the same at 0.9 to 1.0, and at a quarter the Gram matrix a tenth to a sixth. In between whatever
#: is in use stays, so that a feed whose rate wavers does not change to and fro.
_GRAM_BELOW, _COVARIANCE_ABOVE = 0.85, 1.0


class WindowAxis(NamedTuple):
    """What is asked of a window: the root mean square of its mean row, metres, and its leading axis."""

    body_size: float
    axis: LeadingAxis


class FollowedAxis(ABC):
    """The leading axis of a window's rows as the window moves on."""

    @abstractmethod
    def clear(self) -> None:
        """Forget all rows."""

    @abstractmethod
    def update(self, entered: Rows, left: Rows, window: Rows) -> None:
        """Follow the window, as `stream.rolling.Rolling.update` does."""

    @abstractmethod
    def leading(self, window: Rows) -> WindowAxis:
        """Find the leading axis, from the last one found if there is one.

        Parameters
        ----------
        window
            The rows given to the last update.

        Raises
        ------
        ValueError
            There is no row.
        """


class CovarianceAxis(FollowedAxis):
    """The leading axis by the covariance: for windows of more frames than pairs."""

    def __init__(self, width: int) -> None:
        self._covariance = RollingCovariance(width)
        self._last: LeadingAxis | None = None

    def clear(self) -> None:
        """Forget all rows."""
        self._covariance.clear()
        self._last = None

    def update(self, entered: Rows, left: Rows, window: Rows) -> None:
        """Follow the window."""
        self._covariance.update(entered, left, window)

    def leading(self, window: Rows) -> WindowAxis:  # noqa: ARG002 - the sums hold all that is needed
        """Solve the window's covariance."""
        moments = self._covariance.moments()
        self._last = leading_axis(moments.covariance, self._last)
        return WindowAxis(body_size_of(moments.mean), self._last)


class GramAxis(FollowedAxis):
    """The leading axis by the Gram matrix: for windows of fewer frames than pairs."""

    def __init__(self, width: int) -> None:
        self._gram = RollingGram(width)
        #: The last leading vectors, one number per frame, and how many of those frames have left since.
        self._block: Rows | None = None
        self._gone = 0

    def clear(self) -> None:
        """Forget all rows."""
        self._gram.clear()
        self._block = None

    def update(self, entered: Rows, left: Rows, window: Rows) -> None:
        """Follow the window."""
        self._gram.update(entered, left, window)
        self._gone += len(left)

    def leading(self, window: Rows) -> WindowAxis:
        """Solve the window's Gram matrix."""
        gram = self._gram.centred(window)
        found = leading_axis_from(gram, self._start(gram))
        self._block, self._gone = found.block, 0
        # The numbers of the vector add up to nothing, so the rows need not be centred.
        direction = found.vector @ window
        if found.value > 0:
            direction /= math.sqrt(direction.dot(direction))
        else:
            direction[:] = 0.0
            direction[-1] = 1.0
        per_frame = 1.0 / max(len(window) - 1, 1)
        axis = LeadingAxis(
            vector=direction,
            value=per_frame * found.value,
            runner_up=per_frame * found.runner_up,
            total=per_frame * found.total,
            # ‖Cv − λv‖ = ‖Xᵀ(Gu − μu)‖ / ((frames − 1)·√μ), and Xᵀ makes a vector longer by √μ at most.
            residual=found.residual,
            exact=found.exact,
            block=direction[:, None],
        )
        return WindowAxis(math.sqrt(gram.mean_square / len(direction)), axis)

    def _start(self, gram: CentredGram) -> Rows | None:
        """Give the last vectors for the frames now in the window; None when no frame is left.

        New frames have the number of the last one before: nearer than 0, which took every fifth hop a step more.
        """
        if self._block is None or self._gone >= len(self._block):
            return None
        kept = len(self._block) - self._gone
        start = np.empty((self._block.shape[1], len(gram)))
        start[:, :kept] = self._block[self._gone :].T
        start[:, kept:] = start[:, kept - 1 : kept]
        gram.centre(start)
        return start.T


class RollingAxis(FollowedAxis):
    """The leading axis of a window's rows as the window moves on.

    Parameters
    ----------
    width
        Numbers in a row.
    """

    def __init__(self, width: int) -> None:
        self._width = width
        self._by_frames = GramAxis(width)
        # Most windows are short, and would have no use for two matrices of pairs by pairs.
        self._by_pairs: CovarianceAxis | None = None
        self._form: FollowedAxis = self._by_frames

    @property
    def by_frames(self) -> bool:
        """Whether the Gram matrix is in use."""
        return self._form is self._by_frames

    def clear(self) -> None:
        """Forget all rows."""
        self._form.clear()
        self._form = self._by_frames

    def update(self, entered: Rows, left: Rows, window: Rows) -> None:
        """Follow the window, and go over to the other matrix when that costs less."""
        self._form.update(entered, left, window)
        share = len(window) / self._width
        if self.by_frames and share > _COVARIANCE_ABOVE:
            self._by_pairs = self._by_pairs or CovarianceAxis(self._width)
            self._change_to(self._by_pairs, window)
        elif not self.by_frames and share < _GRAM_BELOW:
            self._change_to(self._by_frames, window)

    def _change_to(self, form: FollowedAxis, window: Rows) -> None:
        self._form.clear()
        self._form = form
        form.update(window, window[:0], window)

    def leading(self, window: Rows) -> WindowAxis:
        """Find the leading axis by the matrix in use."""
        return self._form.leading(window)
