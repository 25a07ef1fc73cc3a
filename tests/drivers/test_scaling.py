import pytest

from drivers.scaling import LAYOUTS, Measured, in_child, page, slope
from tests.conftest import SCENES

pytestmark = pytest.mark.serial


def test_slope_is_the_exponent():
    assert slope([10, 100, 1000], [2.0 * n**1.25 for n in (10, 100, 1000)]) == pytest.approx(1.25)


def test_page_extrapolates_what_was_measured():
    rows = [
        {name: Measured(n, 10, s * n / 1000, s * n / 1000, 1.0, 2.0**30) for name, s in zip(LAYOUTS, (8, 4, 6), strict=True)}
        for n in (1000, 10_000)
    ]
    text = page(rows, ["| dofs | basis |", "|---:|---:|", "| 17 | 61 |"])
    assert "| 10,000 | 10 | 80.00 (80.00) | 40.00 (40.00) | 60.00 (60.00) | 0.50 (0.50) | 0.75 (0.75) |" in text
    assert "p = 1.00 (1 rank)" in text
    # 200 ranks take 1,000 frequencies in 5 turns, each as long as two frequencies of a busy pair.
    assert "| 10,000 | 8.000 | 5 | 40.0 | 8,000 | 1.00 |" in text
    assert "| 17 | 61 |" in text and "the best ratio measured above is 0.75" in text


def test_measurements_in_children():
    one, two = (in_child(SCENES / "sdls119a.toml", ranks, 1, 4, groups) for ranks, groups in ((1, 1), (2, 2)))
    assert one.dofs == two.dofs == 100 and one.points == 4
    assert 0 < one.cpu and 0 < one.seconds and one.memory > 5e7
