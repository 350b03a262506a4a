"""How the bench times: medians of turns, exponents, one thread. No figure is held against a limit here."""

from __future__ import annotations

import os
import sys
from itertools import count

import numpy as np
import pytest

from kinespace.tools.bench.timing import exponent, in_turns, one_thread


@pytest.mark.parametrize("power", [-1.0, 0.0, 0.5, 1.0, 2.0])
def test_the_exponent_of_a_known_growth_is_found(power: float) -> None:
    """Costs made as 3 · size^b give b back, exactly without noise and nearly with it."""
    sizes = np.array([105.0, 190.0, 465.0, 1485.0])
    assert exponent(tuple(sizes), tuple(3.0 * sizes**power)) == pytest.approx(power, abs=1e-9)
    noise = np.random.default_rng(1).uniform(0.95, 1.05, 4)
    assert exponent(tuple(sizes), tuple(3.0 * noise * sizes**power)) == pytest.approx(power, abs=0.1)


@pytest.mark.parametrize(
    ("sizes", "costs"), [((1.0,), (2.0,)), ((1.0, 2.0), (1.0,)), ((0.0, 1.0), (1.0, 1.0)), ((1.0, 2.0), (1.0, -1.0))]
)
def test_an_exponent_needs_two_positive_costs(sizes: tuple[float, ...], costs: tuple[float, ...]) -> None:
    """A single size, sizes without costs, and numbers without a logarithm are refused."""
    with pytest.raises(ValueError, match="two positive numbers"):
        exponent(sizes, costs)


@pytest.mark.parametrize("what", [None, "Racing"])
def test_jobs_take_turns_and_the_first_turn_does_not_count(what: str | None) -> None:
    """Every job runs once before the rounds and once in each; the first turn's cost is dropped."""
    order: list[str] = []
    numbers = {name: count() for name in "ab"}

    def job(name: str) -> float:
        order.append(name)
        return float(next(numbers[name]))

    costs = in_turns({name: lambda name=name: job(name) for name in "ab"}, 3, what=what)  # type: ignore[misc]
    assert "".join(order) == "abababab"
    for name in "ab":
        np.testing.assert_array_equal(costs[name], [1.0, 2.0, 3.0])
    with pytest.raises(ValueError, match="rounds"):
        in_turns({}, 0)


def test_linear_algebra_is_pinned_to_one_thread_and_given_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """Inside, BLAS uses one thread and processes started from here will too; outside it is as before."""
    threadpoolctl = pytest.importorskip("threadpoolctl")
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "2")
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)

    def threads() -> list[int]:
        return [each["num_threads"] for each in threadpoolctl.threadpool_info() if each["user_api"] == "blas"]

    before = threads()
    with one_thread() as note:
        assert note is None
        assert set(threads()) == {1}
        assert os.environ["OPENBLAS_NUM_THREADS"] == os.environ["OMP_NUM_THREADS"] == "1"
    assert threads() == before
    assert os.environ["OPENBLAS_NUM_THREADS"] == "2"
    assert "OMP_NUM_THREADS" not in os.environ


@pytest.mark.parametrize(("threads", "told"), [("1", False), ("2", True)])
def test_threads_without_a_limit_cause_a_remark(threads: str, *, told: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without threadpoolctl a process that was not started with one thread says so."""
    monkeypatch.setitem(sys.modules, "threadpoolctl", None)
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", threads)
    with one_thread() as note:
        assert (note is not None) == told
        assert note is None or "kinespace[bench]" in note
