import math

import naive_camera
import numpy as np
import pytest

from kinespace.tools.camera.bodies import Region, landmarks_in, refined, region_around


@pytest.mark.parametrize("seed", range(20))
def test_a_region_as_by_the_textbook(seed: int) -> None:
    """Middle, size and angle agree for a body in any direction."""
    middle, circle = np.random.default_rng(seed).uniform(0, 900, (2, 2))
    ours, theirs = region_around(middle, circle), naive_camera.region(middle, circle)
    np.testing.assert_allclose(ours[:3], theirs[:3])
    assert math.remainder(ours.angle - theirs[3], math.tau) == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("seed", range(6))
def test_landmarks_are_brought_back_as_by_the_textbook(seed: int) -> None:
    """Places in the picture, metres, likelihoods and the next region agree with the loop."""
    generator = np.random.default_rng(seed)
    marks = generator.normal(0, 3, (39, 5)).astype(np.float32)
    marks[:, :2] = generator.uniform(-20, 280, (39, 2))
    world = generator.normal(0, 0.5, (39, 3)).astype(np.float32)
    heat = generator.normal(-4, 3, (64, 64, 39)).astype(np.float32)
    where = Region(*generator.uniform(100, 500, 3), float(generator.uniform(-3, 3)))
    ours = landmarks_in(marks, world, heat, where)
    flat = [naive_camera.refined(marks[place, :2], heat[:, :, place]) for place in range(39)]
    placed = [naive_camera.projected(each, where, 256) for each in flat]
    np.testing.assert_allclose(ours.picture[:, :2], placed[:33], rtol=1e-6)
    np.testing.assert_allclose(ours.picture[:, 2], marks[:33, 2] * where.size / 256, rtol=1e-6)
    np.testing.assert_allclose(ours.world, [naive_camera.turned(each, where.angle) for each in world[:33]], atol=1e-6)
    np.testing.assert_allclose(ours.present, 1 / (1 + np.exp(-marks[:33, 4].astype(float))), rtol=1e-6)
    np.testing.assert_allclose(ours.next_region[:3], naive_camera.region(placed[33], placed[34])[:3], rtol=1e-6)


def test_landmarks_are_refined_where_it_is_warm_alone() -> None:
    """One hot cell draws its landmark to itself; a cold map, and a landmark outside of it, change nothing."""
    heat = np.full((64, 64, 3), -50.0)
    heat[30, 22, 0] = heat[5, 5, 2] = 50.0
    points = np.array([[80.0, 128.0], [80.0, 128.0], [-8.0, 300.0]])
    np.testing.assert_allclose(refined(points, heat), [[88, 120], [80, 128], [-8, 300]])
