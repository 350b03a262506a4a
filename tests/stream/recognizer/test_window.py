"""The window: how many rows it holds; `test_live_windows` compares rows and moments with their definition."""

import numpy as np

from kinespace.stream.recognizer.window import MAX_FEED_RATE, Window


def test_a_feed_that_is_too_fast_shortens_the_window() -> None:
    """It holds the newest rows, as many as the fastest feed has in its seconds, also as rows move back in memory."""
    window, most = Window([0.5], [0.5], np.eye(2)), round(0.5 * MAX_FEED_RATE)
    for number in range(3 * most):
        window.push([number / MAX_FEED_RATE / 2], np.full((1, 2), float(number)))
        kept = range(max(number + 1 - most, 0), number + 1)
        assert window.recent()[0].tolist() == [[each, each] for each in kept]
    found = window.moments(0.5)
    np.testing.assert_allclose([found.mean[0], found.deviation[0]], [[np.mean(kept)] * 2, [np.std(kept)] * 2])
    window.clear()
    assert not len(window.times)
