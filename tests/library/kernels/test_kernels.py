"""Every kernel of the table: compiled as numpy computes it, in each width of registers; wrong arguments refused."""

from __future__ import annotations

import os
import subprocess
import sys
from contextlib import nullcontext
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from programs import ROOT

from kinespace.library import kernels
from kinespace.library.kernels import plain
from kinespace.library.kernels.table import BLOCK, KERNELS, LANE, REGISTER
from kinespace.library.signature.body import Body
from kinespace.library.skeleton import Skeleton

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from numpy.random import Generator

    Arrays = dict[str, np.ndarray]

SEEDS = range(8)
NAMES = pytest.mark.parametrize("name", KERNELS)


@dataclass
class Case:
    """Arguments of a kernel, and the numbers of calls one after another."""

    arrays: Arrays
    constants: Sequence[float] = ()
    calls: Sequence[Sequence[float]] = ((),)
    #: How far numbers may be apart: the comparison is in single precision.
    tolerance: float = 1e-9
    #: Written arrays whose rows have any sign; and arrays that only one of the two kernels writes.
    signless: tuple[str, ...] = ()
    own: tuple[str, ...] = field(default=())

    def copied(self) -> Arrays:
        """Copy the arrays, with NaN in the room between rows where a kernel allows room."""
        return {name: _roomy(each) if name in {"rows", "points"} else each.copy() for name, each in self.arrays.items()}


def _roomy(array: np.ndarray) -> np.ndarray:
    wide = np.full((len(array), array.shape[1] + 3), np.nan)
    wide[:, : array.shape[1]] = array
    return wide[:, : array.shape[1]]


def _zeros(*shape: int, kind: type = np.float64) -> np.ndarray:
    return np.zeros(shape, dtype=kind)


# --- arguments of each kernel ------------------------------------------------------------------------------------


def _distances(generator: Generator) -> Case:
    frames, joints, pairs = generator.integers(1, [40, 60, 90])
    positions = generator.normal(size=(frames, joints, 3)) * 10.0 ** generator.integers(-3, 4)
    arrays = {"positions": positions, "pairs": generator.integers(0, joints, (pairs, 2)), "rows": _zeros(frames, pairs)}
    return Case(arrays, calls=[(frames,), (frames // 2,), (0,)], tolerance=1e-13)


def _window(generator: Generator, width: int) -> tuple[Arrays, list[tuple[float, ...]]]:
    """Give rows that move, stand still and move again, and where the window ends at each call."""
    count = int(generator.integers(8, 150))
    loud = np.where(np.arange(count)[:, None] // 30 % 2, 1e-9, 0.3)
    rows = 2.0 + loud * generator.normal(size=(count, width))
    ends = np.unique([*generator.integers(1, count + 1, size=12), count]).tolist()
    arrays = {
        "rows": rows,
        "times": 1e3 + np.cumsum(generator.choice([1 / 60, 1 / 30, 0.2], size=count)),
        "places": np.zeros(2, dtype=np.intp),
        "drift": _zeros(2),
    }
    return arrays, [(0, 0), *((end, 0) for end in ends), (count, 0), (count, 5)]


def _follow(generator: Generator) -> Case:
    width = int(generator.integers(1, 70))
    arrays, calls = _window(generator, width)
    arrays |= {"sums": _zeros(4, width), "clock": _zeros(3)}
    most = generator.choice([7, 1e6])
    return Case(arrays, (generator.uniform(0.05, 2), most, generator.choice([1e-11, 1e-13, 1e-15]), 1e-6), calls)


def _follow_products(generator: Generator) -> Case:
    width = int(generator.integers(1, 33))
    arrays, calls = _window(generator, width)
    arrays["points"] = arrays.pop("rows")
    ordered = {name: arrays[name] for name in ("points", "times", "places", "drift")}
    ordered |= {"sums": _zeros(2, width), "products": _zeros(width, width)}
    return Case(ordered, (generator.uniform(0.05, 2), 1e6, generator.choice([1e-11, 1e-13, 1e-15]), 1e-6), calls)


def _followed(case: Case, kernel: Callable[..., Callable[..., float]]) -> Arrays:
    """Let sums follow a window to its end."""
    arrays = case.copied()
    call = kernel(*arrays.values(), *case.constants)
    for numbers in case.calls[:-1]:
        call(*numbers)
    return arrays


def _read_parts(generator: Generator) -> Case:
    joints, known = int(generator.integers(2, 13)), bool(generator.integers(4))
    parents = (-1, *(int(generator.integers(0, joint)) for joint in range(1, joints))) if known else ()
    body = Body.of(Skeleton(tuple(f"joint{place}" for place in range(joints)), parents))
    width = len(body.sizing)
    window, calls = _window(generator, width)
    if not generator.integers(4):
        window["rows"][:] = 0.0
    sums = Case(window | {"sums": _zeros(4, width), "clock": _zeros(3)}, (1.0, 1e6, 1e-11, 1e-6), calls)
    read = {name: each for name, each in _followed(sums, plain.follow).items() if name in {"sums", "clock", "places"}}
    read = {"sums": read["sums"], "clock": read["clock"], "places": read["places"]}
    read |= {"sizing": body.sizing, "segments": body.segments, "above": body.above, "ends": body.ends}
    read |= {name: _zeros(width) for name in ("spread", "posture", "trend")}
    for name in ("posture", "trend"):
        if not generator.integers(4):
            read[name] = _zeros(0)
    # Rounding of a variance that is nothing against its mean is as large as the variance.
    return Case(read, (1 / 60, 0.5), tolerance=1e-6)


def _read_eigen(generator: Generator) -> Case:
    case = _follow_products(generator)
    of = _followed(case, plain.follow_products)
    size = len(of["products"])
    found = min(4, size)
    if not generator.integers(4):
        of["drift"][1] = np.inf
    arrays = {"sums": of["sums"], "products": of["products"], "places": of["places"], "drift": of["drift"]}
    arrays |= {"values": _zeros(found), "vectors": _zeros(found, size), "scaled": _zeros(found, size)}
    arrays["block"] = _zeros(size, BLOCK)
    return Case(arrays, calls=[()] * 3, tolerance=1e-6, signless=("scaled",), own=("vectors", "block"))


def _eigenpairs(generator: Generator) -> Case:
    size = int(generator.integers(1, 33))
    found = int(generator.integers(1, min(4, size) + 1))
    points = generator.normal(size=(5, 2 * size, size)) * 2.0 ** -generator.integers(0, 9, size)
    matrices = points.transpose(0, 2, 1) @ points
    matrices[-1], matrices[-2] = 0.0, np.eye(size)
    arrays = {"covariances": matrices, "values": _zeros(5, found), "vectors": _zeros(5, found, size)}
    return Case(arrays, tolerance=1e-9 * size, own=("vectors",))


def _place(generator: Generator) -> Case:
    numbers, kept = generator.integers(1, [100, 130])
    axes = _zeros(numbers, -(-kept // LANE) * LANE, kind=np.float16)
    axes[:, :kept] = generator.normal(size=(numbers, kept))
    origin = generator.normal(size=numbers).astype(np.float32)
    arrays = {"numbers": generator.normal(size=numbers), "origin": origin, "axes": axes, "vector": _zeros(kept)}
    return Case(arrays, tolerance=1e-4)


def _starts(generator: Generator, count: int, most: int) -> np.ndarray:
    inner = generator.permutation(np.arange(1, count))[: generator.integers(0, most)]
    return np.array([0, *np.sort(inner), count], dtype=np.intp)


def _compare(generator: Generator) -> Case:
    count = int(generator.integers(1, 200))
    lanes = -(-(count + REGISTER) // LANE)
    shapes = [(int(generator.integers(1, 40)), int(generator.integers(0, 5))) for _ in range(generator.integers(1, 9))]
    by_products = bool(generator.integers(2))
    groups, windows, begin, first = [], [], 0, 0
    lengths = _zeros(len(shapes), lanes * LANE, kind=np.float32)
    for own, (axes, vectors) in zip(lengths, shapes, strict=True):
        size = axes * max(vectors, 1)
        groups.append((axes, vectors, begin, first))
        laid = _zeros(lanes * LANE, size)
        laid[:count] = generator.normal(size=(count, size)) / size
        windows.append(laid.reshape(lanes, LANE, size).transpose(0, 2, 1).ravel())
        own[:count] = 1.0 if vectors else np.square(laid[:count]).sum(axis=1) + 0.01
        begin, first = begin + size, first + laid.size
    blocks = _starts(generator, count, 12)
    classes = _starts(generator, len(blocks) - 1, 5)
    views = int(generator.integers(1, 9))
    arrays = {
        "groups": np.array(groups, dtype=np.intp),
        "windows": np.concatenate(windows).astype(np.float16),
        "lengths": lengths,
        "weights": generator.dirichlet(np.ones(len(shapes)), size=views).astype(np.float32),
        "blocks": blocks,
        "classes": classes,
        "vectors": generator.normal(size=begin) / 5,
        "products": _zeros(views, lanes * LANE, kind=np.float32),
        "logs": _zeros(views, len(classes) - 1),
        "named": _zeros(len(classes) - 1),
    }
    constants = 0.0 if by_products else 0.01, float(by_products), float(generator.integers(1, views + 1))
    return Case(arrays, constants, tolerance=1e-3, own=("products",))


def _scores(generator: Generator) -> Case:
    count, size = int(generator.integers(1, 200)), int(generator.integers(1, 33))
    lanes = -(-(count + REGISTER) // LANE)
    starts = _starts(generator, count, 6)
    windows = generator.normal(size=(lanes, size, LANE)).astype(np.float32)
    arrays = {"windows": windows, "products": _zeros(lanes * LANE, kind=np.float32), "starts": starts}
    arrays |= {"eigenvector": generator.normal(size=size), "scores": _zeros(len(starts) - 1)}
    return Case(arrays, tolerance=1e-4, own=("products",))


def _follow_phase(generator: Generator) -> Case:
    lengths = generator.integers(1, 30, size=generator.integers(1, 6))
    count, axes, rows = int(lengths.sum()), int(generator.integers(1, 24)), int(generator.integers(1, 4))
    phases = np.concatenate([np.linspace(0, 1, length) for length in lengths])
    bins = np.minimum((phases * 40).astype(np.intp), 39)
    beginning, rounds = generator.dirichlet(np.ones(count), size=2)
    vectors = generator.normal(size=(axes, count)).astype(np.float32)
    arrays = {
        "course": np.array([phases, beginning, rounds, 1 / np.bincount(bins)[bins]]),
        "indices": np.array([bins, phases.argsort(kind="stable")]),
        "starts": np.cumsum([0, *lengths[:-1]]),
        "vectors": vectors,
        "lengths": np.square(vectors).sum(axis=0),
        "expected": generator.normal(size=(rows, count)),
        "constants": np.array([0.55, 0.36, 0.09, 0.1, 1e-6, generator.choice([0.5, 0.02]), 1 / 16, 0.1]),
        "live": generator.normal(size=axes).astype(np.float32) * generator.choice([1, 30]).astype(np.float32),
        "belief": beginning.copy(),
        "after": _zeros(count),
        "room": _zeros(count + REGISTER, kind=np.float32),
        "found": _zeros(2 + rows),
    }
    return Case(arrays, calls=[()] * 6, tolerance=2e-3, own=("after", "room"))


def _moving(generator: Generator) -> Case:
    points, size, axes = generator.integers(1, [90, 33, 65])
    arrays = {"points": generator.normal(size=(points, size)), "whitening": generator.normal(size=(2 * size, axes))}
    arrays |= {"live": _zeros(axes, kind=np.float32), "found": _zeros(2)}
    ends = [sorted(generator.integers(0, points + 1, size=2).tolist()) for _ in range(6)]
    return Case(arrays, (3.0,), [(*each, generator.integers(0, points + 1)) for each in ends], tolerance=1e-4)


def _steps(generator: Generator) -> Case:
    frames, joints = generator.integers(1, [17, 40])
    positions = 5.0 + generator.normal(size=(frames, joints, 3))
    if not generator.integers(3):
        positions[frames // 2, 0] = np.nan
    arrays = {"positions": positions, "last": generator.normal(size=(joints, 3)), "steps": _zeros(frames, joints, 3)}
    arrays |= {"farthest": _zeros(1)}
    return Case(arrays, calls=[(frames,), (1,), (0,)])


def _case(name: str, seed: int) -> Case:
    case: Case = globals()[f"_{name}"](np.random.default_rng(seed))
    return case


# --- compiled and numpy ------------------------------------------------------------------------------------------


def _assert_alike(case: Case, name: str, ours: Arrays, theirs: Arrays) -> None:
    for described in KERNELS[name].arrays:
        one, other = ours[described.name], theirs[described.name]
        if not described.written and described.name not in case.own:
            np.testing.assert_array_equal(one, case.arrays[described.name], err_msg=described.name)
        if described.name in case.signless:
            one, other = one.T @ one, other.T @ other
        if described.name not in case.own:
            largest = max(1.0, np.abs(np.nan_to_num(other, posinf=0.0, neginf=0.0)).max(initial=0.0))
            np.testing.assert_allclose(
                one, other, rtol=case.tolerance, atol=case.tolerance * largest, err_msg=described.name
            )
        if one.base is not None and one.base.shape[-1] == one.shape[-1] + 3:
            assert np.isnan(one.base[:, -3:]).all(), described.name


@NAMES
@pytest.mark.parametrize("seed", SEEDS)
def test_compiled_kernels_compute_what_numpy_computes(name: str, seed: int, width: str) -> None:
    """After each of some calls, all that is written and the number that is given are the same but for rounding."""
    case = _case(name, seed)
    ours, theirs = case.copied(), case.copied()
    call, twin = (
        kernels.bind(name, *ours.values(), *case.constants),
        getattr(plain, name)(*theirs.values(), *case.constants),
    )
    assert type(call).__name__ == "builtin_function_or_method", width
    assert kernels.kind() == f"compiled loops ({width})"
    for numbers in case.calls:
        given, expected = call(*numbers), twin(*numbers)
        assert given == pytest.approx(expected, rel=case.tolerance, abs=case.tolerance, nan_ok=True), numbers
        _assert_alike(case, name, ours, theirs)


@pytest.fixture(params=["compiled", "numpy"])
def arithmetic(request: pytest.FixtureRequest) -> Iterator[str]:
    """Do the arithmetic both ways, as elsewhere, but for one test at a time: the others here set a width."""
    with kernels.left_aside() if request.param == "numpy" else nullcontext():
        yield request.param


@pytest.mark.skipif(kernels.compiled is None, reason="numpy knows the floor as a constant")
@pytest.mark.parametrize("seed", SEEDS)
def test_negative_numbers_have_the_smallest_logarithm(seed: int) -> None:
    """With a floor that leaves no number to take the logarithm of, no sign is taken for a digit."""
    arrays = _read_parts(np.random.default_rng(seed)).copied()
    kernels.bind("read_parts", *arrays.values(), -1.0, 0.0)()
    np.testing.assert_allclose(arrays["spread"], np.log(np.finfo(np.float64).tiny))


@pytest.mark.parametrize("seed", SEEDS)
def test_eigenvectors_are_orthonormal_and_belong_to_their_values(seed: int, arithmetic: str) -> None:
    """Also where eigenvalues are equal, or all 0, and of matrices of any size."""
    case = _case("eigenpairs", seed)
    matrices, values, vectors = case.arrays.values()
    assert kernels.bind("eigenpairs", matrices, values, vectors)()
    units = np.broadcast_to(np.eye(values.shape[1]), (len(values), values.shape[1], values.shape[1]))
    np.testing.assert_allclose(vectors @ vectors.transpose(0, 2, 1), units, atol=1e-11, err_msg=arithmetic)
    largest = max(1.0, values.max())
    np.testing.assert_allclose(vectors @ matrices / largest, values[:, :, None] * vectors / largest, atol=1e-10)
    exact = np.linalg.eigvalsh(matrices)[:, ::-1][:, : values.shape[1]]
    np.testing.assert_allclose(values / largest, exact / largest, atol=1e-10)


@pytest.mark.parametrize("begin", [0.0, 1.0, np.nan, np.inf])
def test_one_covariance_after_another_is_read_as_each_alone(begin: float, width: str) -> None:
    """What is taken over from the window before, even nonsense, does not change what is found; later it is of use."""
    generator = np.random.default_rng(5)
    points, taken = (generator.normal(size=(400, 32)) * 2.0 ** -(np.arange(32) / 2)).cumsum(axis=0), 0
    sums = np.zeros((2, 32)), np.zeros((32, 32)), np.array([0, 60]), np.zeros(2)
    block, of = np.full((32, BLOCK), begin), (np.zeros(4), *np.zeros((2, 4, 32)))
    others = (np.zeros(4), *np.zeros((2, 4, 32)), np.zeros((32, BLOCK)))
    read, twin = kernels.bind("read_eigen", *sums, *of, block), plain.read_eigen(*sums, *others)
    for end in range(60, 400, 3):
        relative = points[end - 60 : end] - points[end - 60]
        sums[0][1], sums[1][:] = relative.sum(axis=0), relative.T @ relative
        trace = read()
        assert trace == pytest.approx(twin())
        np.testing.assert_allclose(of[0], others[0], atol=1e-9 * trace, err_msg=width)
        np.testing.assert_allclose(of[2].T @ of[2], others[2].T @ others[2], atol=1e-6)
        taken += np.allclose(block.T @ block, np.eye(BLOCK))
    assert taken > 50


def test_numbers_that_are_none_are_noticed(arithmetic: str) -> None:
    """Covariances with NaN have no eigenpairs; a window with NaN or infinity is near to nothing."""
    for name, failed in (("eigenpairs", 0.0), ("read_eigen", np.nan)):
        case = _case(name, 3)
        [*case.arrays.values()][0 if name == "eigenpairs" else 1][:] = np.nan
        given = kernels.bind(name, *case.arrays.values(), *case.constants)()
        assert given == pytest.approx(failed, nan_ok=True), arithmetic
    case = _case("compare", 1)
    case.constants = (0.01, 0.0, 1.0)
    usual = _logs(case)
    for strange in (np.nan, np.inf):
        case.arrays["vectors"][:] = strange
        logs = _logs(case)
        assert not (logs <= usual.max()).any(), strange


def _logs(case: Case) -> np.ndarray:
    with np.errstate(all="ignore"):
        kernels.bind("compare", *case.arrays.values(), *case.constants)()
    return case.arrays["logs"].copy()


def test_numpy_takes_what_is_too_large_for_the_compiled_kernels() -> None:
    """More joints or directions than the stack has room for are not refused."""
    rows = np.zeros((1, 1))
    kernels.bind("distances", np.arange(900.0).reshape(1, 300, 3), np.array([[0, 299]]), rows)(1)
    assert rows[0, 0] == pytest.approx(299 * 3 * 3**0.5)
    sums = np.zeros((2, 40)), np.zeros((40, 40))
    window = np.ones((4, 40)), np.arange(4.0), np.zeros(2, dtype=np.intp), np.zeros(2)
    assert kernels.bind("follow_products", *window, *sums, 9.0, 9.0, 1e-11, 1e-6)(4, 0) == 1.0
    assert sums[0].tolist() == [[1.0] * 40, [0.0] * 40]


# --- refused -----------------------------------------------------------------------------------------------------


def _wrong(name: str) -> Iterator[tuple[str, list[Any]]]:
    """Give arguments of a kernel of which one array does not fit, and the name of that array."""
    described, arrays = KERNELS[name].arrays, [*_case(name, 0).copied().values()]
    letters = "".join(each.shape for each in described)
    for place, each in enumerate(described):
        array, wrongs = arrays[place], list[Any]()
        wrongs += [array.astype(np.complex128), array[None], np.zeros(array.shape, np.int8)]
        for axis, letter in enumerate(each.shape):
            if letter.isdigit() or letters.index(letter) < sum(len(other.shape) for other in described[:place]) + axis:
                wrongs.append(np.repeat(array, 2, axis=axis))
        if each.below:
            wrongs += [np.full_like(array, 10**4), np.full_like(array, -1)] if array.dtype != np.uint16 else []
        if array.size > 1 and array.shape[-1] > 1:
            wrongs.append(np.repeat(array, 2, axis=-1)[..., ::2])
        if each.written:
            frozen = array.copy()
            frozen.flags.writeable = False
            wrongs.append(frozen)
        for wrong in wrongs:
            yield each.name, [*arrays[:place], wrong, *arrays[place + 1 :]]


@NAMES
def test_arrays_that_do_not_fit_are_refused(name: str) -> None:
    """An array of another type, shape, layout or range raises ValueError with its name and the expectation."""
    case, refused = _case(name, 0), 0
    for wrong, arrays in _wrong(name):
        with pytest.raises(ValueError, match=r"^\w+: expected .*(, got )?") as raised:
            kernels.bind(name, *arrays, *case.constants)
        # A length that stands in several arrays may be missed only in the next one.
        assert str(raised.value).split(":")[0] in {wrong, *(each.name for each in KERNELS[name].arrays)}
        refused += 1
    assert refused > 4 * len(case.arrays)
    with pytest.raises(ValueError, match=f"arrays: expected {len(case.arrays)}|{name}: expected"):
        kernels.bind(name, *[*case.arrays.values()][1:])
    with pytest.raises(ValueError, match=f"{name}: expected .*, got"):
        kernels.bind(name, *case.arrays.values(), *case.constants, 1.0)


def test_memory_that_is_written_is_in_no_other_array() -> None:
    """Rows may not lie over the positions that they are measured from."""
    memory, pairs = np.ones((8, 3)), np.array([[0, 1]])
    with pytest.raises(ValueError, match="rows: expected memory that is in no other array"):
        kernels.bind("distances", memory[None], pairs, memory[:1, :1])


@NAMES
def test_numbers_of_a_call_are_checked(name: str, width: str) -> None:
    """Too many numbers, none, text, NaN, numbers below 0 and beyond an array are refused before anything is read."""
    case = _case(name, 2)
    call = kernels.bind(name, *case.copied().values(), *case.constants)
    usual = [0.0] * len(KERNELS[name].numbers)
    with pytest.raises(TypeError, match=f"expected {len(usual)} numbers, got {len(usual) + 1}"):
        call(*usual, 1.0)
    for place in range(len(usual)):
        for strange, error in ((-1.0, ValueError), (np.nan, ValueError), (1e16, ValueError), ("2", TypeError)):
            numbers: list[Any] = [*usual]
            numbers[place] = strange
            with pytest.raises(error, match="number"):
                call(*numbers)
    limits = [place for place, limit in enumerate(KERNELS[name].numbers) if limit]
    for place in limits:
        numbers = [*usual]
        numbers[place] = len(case.arrays["times" if "times" in case.arrays else next(iter(case.arrays))]) + 1
        with pytest.raises(ValueError, match=f"number {place}: expected 0 to"):
            call(*numbers)
    assert kernels.kind().endswith(f"({width})")


def test_a_kernel_or_width_that_is_none_is_refused(width: str) -> None:
    """The compiled module names what it expected."""
    built = kernels.compiled
    assert built is not None
    with pytest.raises(ValueError, match="name: expected a kernel, got nonsense"):
        built.bind("nonsense", (), (), (), ())
    with pytest.raises(ValueError, match="steps: expected fewer arguments"):
        built.bind("steps", (1,) * 17, (), (), ())
    with pytest.raises(ValueError, match=r"kind: expected any, avx2 or avx512, .* got mmx"):
        built.use("mmx")
    assert built.kind() == width


# --- which kernels are in use --------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("old", [True, False])
def test_kernels_built_from_older_sources_or_switched_off_are_not_used(*, old: bool) -> None:
    """A module of another version is left aside, and with KINESPACE_COMPILED=0 any module."""
    code = "from kinespace.library import kernels; print(kernels.kind())"
    if old:
        code = (
            "import sys, types; older = types.ModuleType('kinespace.library.kernels._compiled'); older.VERSION = 1; "
            f"sys.modules[older.__name__] = older; {code}"
        )
    environment = os.environ | ({} if old else {"KINESPACE_COMPILED": "0"})
    given = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, env=environment, capture_output=True, text=True, check=True, timeout=60
    )
    assert given.stdout == "numpy\n"
