from dataclasses import replace

import numpy as np
import pytest
from naive_windows import evidence, logit

from kinespace.library import MotionLibrary, WindowIndex, by_joints
from kinespace.library.windows import rejection as judging
from kinespace.library.windows.comparer import named_and_alone
from kinespace.library.windows.rejection import MAX_LEAD, RATES, Evidence, Rejection

REJECTION = Rejection(
    weights=np.array([-2.0, -1.0, 1.5, 0.25, 0.5]),
    offset=0.75,
    biases={"walk": 0.5, "jump": -0.25},
    slopes={"walk": 0.25, "jump": 0.0},
    thresholds=np.array([3.0, 2.5, 2.0, 1.0, 0.5, -1.0]),
    typical=np.array([0.5, -0.25, 1.0, 0.5]),
    joints=31,
    over=0.125,
)
EVIDENCE = Evidence(distances=(0.5, -1.0), leads=(1.0, -0.5), noise=0.01)


@pytest.fixture(scope="module")
def learning(builtin: MotionLibrary) -> WindowIndex:
    """Give an index that has to learn from its own motions: six classes by three people, twelve joints."""
    fewer = builtin.without(classes=builtin.classes[1::2], actors=("bk", "tr"))
    fewer = fewer.restricted_to(fewer.skeleton.joints[::3])
    return WindowIndex.of(replace(fewer, learned={}))


def _shares_known(index: WindowIndex, *, with_class: bool) -> list[float]:
    """Give at three rates the share of windows that are known, their person left out, perhaps with their class."""
    motions = [index.library.motions[each] for each in index.motions]
    rejection, weighing, logits = judging.learned_rejection(index), index.comparison.weighing, []
    for window, motion in enumerate(motions):
        own = (() if with_class else (motion.class_name,), motion.actor)
        left_out = [other.actor == own[1] or other.class_name in own[0] for other in motions]
        named, alone = named_and_alone(index.asked_by(window, np.array(left_out)), weighing)
        guess = int(named.argmin())
        logits.append(rejection.logit(Evidence.of(alone, guess), index.classes[guess]))
    return [float(np.mean(np.array(logits) >= rejection.threshold_at(rate))) for rate in (0.05, 0.2, 0.4)]


def test_one_persons_motions_teach_nothing_of_the_unknown(learning: WindowIndex) -> None:
    """Three persons' motions do; the same motions as one person's are judged by likelihood ratios."""
    motions = [replace(each, actor="ann") for each in learning.library.motions]
    alone = WindowIndex.of(replace(learning.library, motions=tuple(motions)))
    assert [each.rejection.by_likelihood for each in (learning, alone)] == [False, True]


def test_evidence_is_read_off_each_group_alone() -> None:
    """A guess may be behind in one group, and lead another by more than counts; alone it leads by nothing."""
    groups = np.array([[0.5, 1.0, 4.0], [0.25, 0.0, -1.0]])
    for guess in range(3):
        distances, leads = evidence(groups, guess)
        read = Evidence.of(groups, guess, noise=0.01)
        assert (read.distances, read.leads) == (pytest.approx(distances), pytest.approx(leads))
        assert read.compared == read.distances + read.leads
        assert read.lead == pytest.approx(np.mean(leads))
        assert read.noisiness == pytest.approx(np.log(2))
    assert Evidence.of(groups, 2).leads[0] == -MAX_LEAD
    assert Evidence.of(np.array([[0.5, 9.0]]), 0).leads == (MAX_LEAD,)
    assert Evidence.of(np.array([[0.5], [1.0]]), 0).leads == (0.0, 0.0)
    assert Evidence.of(np.array([[0.5, np.inf], [1.0, 2.0]]), 0).leads == (0.0, 1.0)


@pytest.mark.parametrize(("class_name", "bias", "slope"), [("walk", 0.5, 0.25), ("jump", -0.25, 0), ("sit", 0, 0)])
def test_evidence_is_weighed(class_name: str, bias: float, slope: float) -> None:
    """As by the twin; a class that was not learned has no bias and no slope."""
    numbers = REJECTION.weights.tolist(), EVIDENCE.compared, REJECTION.typical.tolist(), EVIDENCE.noise
    weighed = logit(*numbers, offset=REJECTION.offset, bias=bias, slope=slope)
    assert REJECTION.logit(EVIDENCE, class_name) == pytest.approx(weighed)


def test_numbers_come_back_from_a_librarys_file() -> None:
    """They are kept as named arrays of single precision, those for few joints beside the others, if there are any."""
    few = replace(REJECTION, offset=7.0, biases={"sit": 1.0}, slopes={}, joints=12)
    learned = {**REJECTION.kept(), **few.kept(few=True)}
    for is_few, kept in ((False, REJECTION), (True, few)):
        again = Rejection.of_kept(learned, 2, few=is_few)
        for name in ("weights", "thresholds", "typical"):
            assert np.array_equal(getattr(again, name), getattr(kept, name))
        assert (again.offset, again.biases, again.slopes) == (kept.offset, kept.biases, kept.slopes)
        assert (again.joints, again.over) == (kept.joints, 0.125)
        assert again.logit(EVIDENCE, "walk") == pytest.approx(kept.logit(EVIDENCE, "walk"))
    assert [judging.most_of_few(each) for each in (learned, REJECTION.kept(), {})] == [12, 0, 0]


@pytest.mark.parametrize("name", ["weights", "offset", "thresholds", "typical", "joints", "over", "bias walk"])
@pytest.mark.parametrize("wrong", [None, np.zeros(7), np.array([np.nan])], ids=["missing", "more", "no number"])
def test_numbers_that_do_not_fit_are_refused(name: str, wrong: np.ndarray | None) -> None:
    """The message names them; a class may be missing, and in older files how long evidence is averaged."""
    arrays: dict[str, np.ndarray] = dict(REJECTION.kept())
    arrays.pop(name)
    if wrong is None and name.startswith("bias"):
        assert Rejection.of_kept(arrays, 2).biases == {"jump": -0.25}
        return
    if wrong is None and name == "over":
        assert Rejection.of_kept(arrays, 2).over == pytest.approx(judging.USUAL_OVER)
        wrong = np.zeros(1)
    if wrong is not None:
        arrays[name] = wrong
    with pytest.raises(ValueError, match=f"^{name}: expected"):
        Rejection.of_kept(arrays, 2)


def test_the_more_may_be_named_the_lower_the_threshold() -> None:
    """Thresholds are as kept at kept rates, in a straight line of log rates between them, and constant beyond."""
    assert [REJECTION.threshold_at(rate) for rate in RATES] == pytest.approx(REJECTION.thresholds.tolist())
    assert REJECTION.threshold_at((0.05 * 0.1) ** 0.5) == pytest.approx(1.5)
    assert REJECTION.threshold_at(0.0) == REJECTION.threshold_at(RATES[0])
    assert REJECTION.threshold_at(1.0) == REJECTION.threshold_at(RATES[-1])


@pytest.mark.slow
def test_a_library_learns_from_its_own_motions(learning: WindowIndex) -> None:
    """Motions of a person left out are mostly known; of motions without their class as many as the rate says."""
    assert _shares_known(learning, with_class=True)[1] > 0.75
    assert _shares_known(learning, with_class=False) == pytest.approx([0.05, 0.2, 0.4], abs=0.08)


def test_too_few_motions_to_learn_from(sticks: MotionLibrary) -> None:
    """A library of one motion, or of one class, is judged by likelihood ratios."""
    alone = WindowIndex.of(replace(sticks, motions=sticks.motions[:1]))
    for index in (alone, WindowIndex.of(sticks.without(classes=sticks.classes[1:]))):
        assert index.rejection.by_likelihood
        assert index.comparer.likelihood is not None
        assert index.rejection.held == judging.HELD_ONE
    assert np.array_equal(judging.typical_evidence(alone), np.zeros(4))
    near, far = (alone.rejection.logit(Evidence((each,), (0.0,)), "") for each in (-3.0, 0.0))
    assert near > alone.rejection.threshold_at(0.05) > far


def test_of_many_classes_a_guess_needs_more() -> None:
    """Among n classes by log n, because some is like any movement by chance; the only class leads clearly."""
    evidence = Evidence((-3.0,), (MAX_LEAD,))
    among = [judging.by_likelihood(count).logit(evidence, "") for count in (2, 8)]
    assert among[0] - among[1] == pytest.approx(np.log(4))
    assert judging.by_likelihood(1).logit(Evidence((-3.0,), (0.0,)), "") == pytest.approx(3.0 + MAX_LEAD)


@pytest.mark.slow
def test_a_library_with_learned_numbers_uses_them(builtin_index: WindowIndex) -> None:
    """With all joints as in the built-in library's file, with fewer moved to what is typical of these."""
    learned = builtin_index.library.learned
    kept, rejection = Rejection.of_kept(learned, 5), builtin_index.rejection
    assert rejection is builtin_index.rejection
    assert (rejection.offset, rejection.typical.tolist()) == (kept.offset, kept.typical.tolist())
    assert np.array_equal(rejection.weights, kept.weights)
    # Opened alone: what is derived from the built-in library is opened by its whole.
    some, most = WindowIndex.of(builtin_index.of_some(range(0, 288, 9)).library), judging.most_of_few(learned)
    for joints, expected in ((most + 1, kept), (most, Rejection.of_kept(learned, 5, few=True))):
        view = by_joints(some, builtin_index.library.skeleton.joints[-joints:])
        assert np.array_equal(view.rejection.thresholds, expected.thresholds)
        assert not np.array_equal(view.rejection.typical, expected.typical)
