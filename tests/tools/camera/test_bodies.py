import numpy as np

from kinespace.tools.camera.bodies import Bodies, Landmarks, Region

_PICTURE = np.zeros((360, 640, 3), dtype=np.uint8)


class _Stage:
    """Bodies at places that the test moves; counts the looks at whole pictures and at regions."""

    def __init__(self, **people: tuple[float, float, float]) -> None:
        self.people = {name: Region(*place, 0.0) for name, place in people.items()}
        self.wholes = self.regions = 0

    def put(self, **people: tuple[float, float, float] | None) -> None:
        for name, place in people.items():
            if place is None:
                del self.people[name]
            else:
                self.people[name] = Region(*place, 0.0)

    def bodies(self, picture: np.ndarray) -> list[Region]:
        assert picture is _PICTURE
        self.wholes += 1
        return [*self.people.values()]

    def landmarks(self, picture: np.ndarray, where: Region) -> Landmarks | None:
        assert picture is _PICTURE
        self.regions += 1
        near = [each for each in self.people.values() if abs(each.x - where.x) + abs(each.y - where.y) < where.size / 2]
        if not near:
            return None
        place = np.full((33, 3), near[0].x)
        return Landmarks(place, place, np.ones(33), near[0])


def _seen(bodies: Bodies, time: float) -> dict[str, float]:
    return {each.name: float(each.landmarks.picture[0, 0]) for each in bodies.seen(_PICTURE, time)}


def test_the_detector_looks_while_the_body_is_lost_alone() -> None:
    """A body that was found is followed by its landmarks; once it is lost every picture is looked at as a whole."""
    stage = _Stage(ann=(100, 180, 200))
    bodies = Bodies(stage, 1, "camera")
    for count in range(10):
        stage.put(ann=(100 + 30 * count, 180, 200))
        assert _seen(bodies, count / 30) == {"camera": 100 + 30 * count}
    assert (stage.wholes, stage.regions) == (1, 10)
    stage.put(ann=None)
    assert [_seen(bodies, 1 + count / 30) for count in range(3)] == [{}] * 3
    assert stage.wholes == 4


def test_one_body_is_the_largest() -> None:
    """Nobody else takes its place while it is there, and it keeps its place after it was lost for a moment."""
    stage = _Stage(ann=(100, 180, 150), bob=(500, 180, 250))
    bodies = Bodies(stage, 1, "camera")
    assert _seen(bodies, 0.0) == {"camera": 500}
    stage.put(ann=(100, 180, 400))
    assert _seen(bodies, 0.1) == {"camera": 500}
    stage.put(bob=None)
    assert _seen(bodies, 0.2) == {"camera": 100}


def test_a_body_lost_for_a_moment_comes_before_a_larger_one() -> None:
    """The detector finds both; the one near the place of the lost one is taken."""
    stage = _Stage(bob=(500, 180, 200))
    bodies = Bodies(stage, 1, "camera")
    _seen(bodies, 0.0)
    stage.put(bob=None)
    assert _seen(bodies, 0.1) == {}
    stage.put(ann=(100, 180, 280), bob=(520, 180, 200))
    assert _seen(bodies, 0.2) == {"camera": 520}
    # After a while nobody waits for it.
    stage.put(ann=None, bob=None)
    _seen(bodies, 0.3)
    stage.put(ann=(100, 180, 280), bob=(520, 180, 200))
    assert _seen(bodies, 9.0) == {"camera": 100}


def test_names_stay_with_their_bodies() -> None:
    """A further body is looked for twice a second; one that comes back where it left has its name again."""
    stage = _Stage(ann=(100, 180, 120))
    bodies = Bodies(stage, 3, "stage")
    assert _seen(bodies, 0.0) == {"stage": 100}
    stage.put(bob=(400, 180, 150))
    assert _seen(bodies, 0.1) == {"stage": 100}
    assert _seen(bodies, 0.6) == {"stage": 100, "stage-2": 400}
    stage.put(ann=None)
    assert _seen(bodies, 0.7) == {"stage-2": 400}
    stage.put(cyd=(600, 180, 100))
    assert _seen(bodies, 1.2) == {"stage-2": 400, "stage-3": 600}
    stage.put(ann=(130, 180, 120))
    assert _seen(bodies, 1.8) == {"stage": 130, "stage-2": 400, "stage-3": 600}


def test_a_body_found_twice_is_one() -> None:
    """Two names whose bodies run into each other are one body; the detector's second region of it is none."""
    stage = _Stage(ann=(100, 180, 120), bob=(400, 180, 120))
    bodies = Bodies(stage, 2, "camera")
    assert len(_seen(bodies, 0.0)) == 2
    stage.put(bob=None)
    stage.put(ann=(390, 180, 120))
    assert _seen(bodies, 0.1) == {"camera-2": 390}
    stage.put(twin=(395, 180, 120))
    assert len(_seen(bodies, 1.0)) == 1
