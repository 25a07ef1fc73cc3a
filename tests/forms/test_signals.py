import math

import numpy as np
import pytest

from forms.signals import Ricker, Table, read_accelerogram, tabulate
from meshes.checked import ModelError

PULSE = Ricker(math.exp(1.5) / 2, 1.0, 1.92, 0.9)


def test_ricker_has_its_trough_lobes_and_zeros():
    t = np.linspace(0, 5, 200_001)
    a = PULSE(t)
    assert a.min() == pytest.approx(-PULSE.amplitude, rel=1e-9)
    assert t[np.argmin(a)] == pytest.approx(1.92, abs=1e-4)
    assert a.max() == pytest.approx(1.0, rel=1e-8)
    lobe = 1.92 + math.sqrt(1.5) / math.pi
    assert PULSE(np.array([lobe]))[0] == pytest.approx(1.0, rel=1e-12)
    assert np.all(a[t < 0.9] == 0)
    assert PULSE(np.array([0.9]))[0] > 1e-3


def test_table_is_linear_between_its_rows_and_zero_outside():
    table = tabulate(PULSE, 0.01, 5.0, 7)
    assert table(np.array([2.335]))[0] == pytest.approx(0.5 * table(np.array([2.33, 2.34])).sum(), rel=1e-14)
    assert table(np.array([-1.0, 100.0])).tolist() == [0.0, 0.0]


def test_table_is_rounded_up():
    table = tabulate(PULSE, 0.01, 5.0, 7)
    exact = PULSE(table.times)
    error = table.values - exact
    assert np.all(error >= 0)
    assert np.all(error <= 1e-6 * np.abs(exact) + 1e-300)
    assert tabulate(PULSE, 0.01, 5.0, 17).values == pytest.approx(exact, rel=1e-15)


@pytest.mark.parametrize(
    "text",
    ["t,a\n0,0\n1,2\n3,4\n", "# made up\n0;0\n1;2\n3;4\n", "time\taccel\r\n0\t0\r\n1\t2\r\n3\t4\r\n", "0,0,\n1,2,\n3,4,\n"],
)
def test_accelerogram_is_read(tmp_path, text):
    path = tmp_path / "record.csv"
    path.write_text(text, encoding="utf-8")
    table = read_accelerogram(path, scale=9.81)
    assert table(np.array([0.5, 2.0, 3.0])) == pytest.approx([9.81, 3 * 9.81, 4 * 9.81])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("0,0\n1,nan\n", "line 2: expected finite"),
        ("0,0\n1,inf\n", "line 2: expected finite"),
        ("0,0\n1,2\n1,3\n", "line 3: expected increasing times"),
        ("0,0\n1,2\nlast,3\n", "line 3: expected a time and an acceleration"),
        ("0,01;1,5\n0,02;1,6\n", "line 2: expected a time and an acceleration"),
        ("t,a\n", "at least two lines"),
        ("0,0,1\n1,2,3\n", "line 2: expected a time and an acceleration"),
    ],
)
def test_bad_accelerogram_is_refused_by_line(tmp_path, text, words):
    path = tmp_path / "record.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ModelError, match=words):
        read_accelerogram(path)


def test_missing_accelerogram_is_named(tmp_path):
    with pytest.raises(ModelError, match="cannot read .*nowhere.csv"):
        read_accelerogram(tmp_path / "nowhere.csv")


def test_table_must_increase():
    with pytest.raises(ModelError, match="row 3"):
        Table(np.array([0.0, 2.0, 1.0]), np.zeros(3))
