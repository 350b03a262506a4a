"""The window: how many rows it holds; `test_live_windows` compares rows and moments with their definition."""

import numpy as np
from synthetic import plain_index

from kinespace.stream.recognizer.window import MAX_FEED_RATE, Window

#: Joints of a body, and its pairs.
JOINTS, WIDTH = 4, 6


def test_a_feed_that_is_too_fast_shortens_the_window() -> None:
    """It holds the newest rows, as many as the fastest feed has in its seconds, also as rows move back in memory."""
    window, most = Window(plain_index(0.5, JOINTS)), round(0.5 * MAX_FEED_RATE)
    for number in range(3 * most):
        window.push([number / MAX_FEED_RATE / 2], np.full((1, WIDTH), 1.0 + number))
        kept = range(max(number + 1 - most, 0) + 1, number + 2)
        assert window.recent()[1].tolist() == [[each] * WIDTH for each in kept]
    found = window.moments(0.5)
    np.testing.assert_allclose(found.mean[0], [np.mean(kept)] * WIDTH)
    np.testing.assert_allclose(found.deviation[0], [np.std(kept)] * WIDTH)
    window.clear()
    assert not len(window.recent()[0])
