"""Outlines of plates and holes: star-shaped polygons in any plane pass, and each of them is refused once it is spoilt."""

import numpy as np
import pytest

from uplift.meshes.checked import ModelError
from uplift.meshes.outlines import area_vector, check_outlines


def star(rng, n, radius, center=(0.0, 0.0)):
    """A polygon (n, 2) that no ray from its centre crosses twice."""
    angles = 2 * np.pi * (np.arange(n) + 0.6 * rng.random(n)) / n
    return np.asarray(center) + radius * (0.5 + 0.5 * rng.random(n))[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)


def in_space(rng):
    """A map from the plane to space: turned, moved and scaled."""
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0][:2] * 10.0 ** rng.integers(-4, 5)
    shift = 10 * np.linalg.norm(axes) * rng.normal(size=3)
    return lambda outline: outline @ axes + shift


@pytest.mark.parametrize("seed", range(20))
def test_star_shaped_plates_with_holes_apart_are_plates(seed):
    rng = np.random.default_rng(seed)
    place = in_space(rng)
    holes = [star(rng, int(rng.integers(4, 12)), 0.5, center) for center in ((-1.2, 0.0), (1.2, 0.0), (0.0, 1.2))]
    outline = star(rng, int(rng.integers(6, 200)), 8.0)
    for turn in (1, -1):
        check_outlines(place(outline)[::turn], [place(hole) for hole in holes])
    x, y = outline.T
    shoelace = 0.5 * abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
    scale = np.linalg.norm(place(np.eye(2))[0] - place(np.zeros((1, 2)))[0])
    assert np.linalg.norm(area_vector(place(outline))) == pytest.approx(scale**2 * shoelace, rel=1e-9)


SQUARE = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])
SMALL = 0.25 * SQUARE
ELL = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [3.0, 4.0], [3.0, 1.0], [0.0, 1.0]])


@pytest.mark.parametrize(
    ("corners", "holes", "key", "words"),
    [
        (SQUARE[[0, 0, 1, 2, 3]], [], "corners", "cross or meet"),
        (np.insert(SQUARE, 1, [1e-8, 0.0], axis=0), [], "corners", "cross or meet"),
        (np.insert(SQUARE, 2, [6.0, 0.0], axis=0)[[0, 2, 1, 3, 4]], [], "corners", "cross or meet"),  # out and back along a line
        (np.insert(SQUARE, 4, [2.0, 0.0], axis=0), [], "corners", "cross or meet"),  # a corner on another edge
        (np.insert(SQUARE, 4, [2.0, 1e-7], axis=0), [], "corners", "cross or meet"),
        (SQUARE[[0, 1, 3, 2]], [], "corners", "edges cross"),
        (SQUARE[[0, 1, 3, 2]] + [[0, 0], [0, 0], [0, 0], [1, 0]], [], "corners", "cross or meet"),
        (SQUARE, [SMALL], "holes[1]", "inside the plate"),  # on the rim
        (SQUARE, [SMALL + 3.5], "holes[1]", "inside the plate"),  # across it
        (SQUARE, [SMALL + 5.0], "holes[1]", "inside the plate"),
        (SQUARE, [SQUARE], "holes[1]", "inside the plate"),
        (SQUARE, [2 * SQUARE - 2], "holes[1]", "inside the plate"),  # around it
        (ELL, [0.2 * SQUARE + [1.0, 2.0]], "holes[1]", "inside the plate"),  # in the notch
        (SQUARE, [SMALL + 1, SMALL + 1.5], "holes[2]", "meets hole 1"),
        (SQUARE, [SMALL + 1, SMALL + 1], "holes[2]", "meets hole 1"),
        (SQUARE, [SMALL + 1, 0.5 * SMALL + 1.2], "holes[2]", "meets hole 1"),
        (SQUARE, [0.5 * SMALL + 1.2, SMALL + 1], "holes[2]", "meets hole 1"),
        (SQUARE, [SMALL + 1, SMALL + [2, 1]], "holes[2]", "meets hole 1"),  # side by side
        (SQUARE, [SMALL[[0, 2, 1, 3]] + 1], "holes[1]", "around the hole"),
        (SQUARE, [np.array([[1.0, 1.0], [2.0, 1.0], [3.0, 1.0]])], "holes[1]", "around the hole"),
        (SQUARE, [np.ones((3, 2))], "holes[1]", "around the hole"),
        (SQUARE, [SMALL[:2] + 1], "holes[1]", "at least 3"),
    ],
)
def test_what_is_none_is_refused(corners, holes, key, words):
    place = in_space(np.random.default_rng(0))
    with pytest.raises(ModelError, match=words) as error:
        check_outlines(place(corners), [place(hole) for hole in holes])
    assert error.value.key == key


def test_a_hole_off_the_plane_is_refused():
    flat = np.pad(SQUARE, ((0, 0), (0, 1)))
    hole = np.pad(SMALL + 1, ((0, 0), (0, 1)))
    check_outlines(flat, [hole])
    with pytest.raises(ModelError, match="in the plane"):
        check_outlines(flat, [hole + [0.0, 0.0, 1e-3]])
