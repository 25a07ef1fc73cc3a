import math

import numpy as np
import pytest
from scipy.signal import chirp

from uplift.forms.loads.records import RecordChoice, read_record
from uplift.forms.loads.signals import Noise, Ricker, Sweep, Table, tabulate, tapered
from uplift.meshes.checked import ModelError

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
    table = tabulate(PULSE, 0.01, 5.0, 6)
    assert table(np.array([2.335]))[0] == pytest.approx(0.5 * table(np.array([2.33, 2.34])).sum(), rel=1e-14)
    assert table(np.array([-1.0, 100.0])).tolist() == [0.0, 0.0]


def test_table_is_rounded_to_nearest():
    table = tabulate(PULSE, 0.01, 5.0, 6)
    exact = PULSE(table.times)
    acting = exact != 0
    unit = 10.0 ** (np.floor(np.log10(np.abs(exact[acting]))) - 5)  # of the sixth significant digit
    error = (table.values[acting] - exact[acting]) / unit
    assert np.all(np.abs(error) <= 0.5 + 1e-9)
    assert error.min() < -0.4 and error.max() > 0.4
    assert np.all(table.values[~acting] == 0)
    assert table.values[192] == -2.24084  # -exp(3/2) / 2 = -2.2408445...
    assert tabulate(PULSE, 0.01, 5.0, 17).values == pytest.approx(exact, rel=1e-15)


@pytest.mark.parametrize(
    "text",
    ["t,a\n0,0\n1,2\n3,4\n", "# made up\n0;0\n1;2\n3;4\n", "time\taccel\r\n0\t0\r\n1\t2\r\n3\t4\r\n", "0,0,\n1,2,\n3,4,\n"],
)
def test_accelerogram_is_read(tmp_path, text):
    path = tmp_path / "record.csv"
    path.write_text(text, encoding="utf-8")
    table = read_record(path, RecordChoice(scale=9.81))
    assert table(np.array([0.5, 2.0, 3.0])) == pytest.approx([9.81, 3 * 9.81, 4 * 9.81])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("0,0\n1,nan\n", "line 2: expected finite"),
        ("0,0\n1,inf\n", "line 2: expected finite"),
        ("0,0\n1,2\n1,3\n", "line 3: expected increasing times"),
        ("0,0\n1,2\nlast,3\n", "line 3: expected a time and an acceleration"),
        ("0,01;1,5\n0,02;1.6\n", "line 2: expected a time and an acceleration"),
        ("t,a\n", "at least two lines"),
        ("0,0,1\n1,2,3\n", "column: missing; .* has 3 columns: expected one of 2, 3"),
    ],
)
def test_bad_accelerogram_is_refused_by_line(tmp_path, text, words):
    path = tmp_path / "record.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ModelError, match=words):
        read_record(path, RecordChoice())


def test_missing_accelerogram_is_named(tmp_path):
    with pytest.raises(ModelError, match="cannot read .*nowhere.csv"):
        read_record(tmp_path / "nowhere.csv", RecordChoice())


def test_table_must_increase():
    with pytest.raises(ModelError, match="row 3"):
        Table(np.array([0.0, 2.0, 1.0]), np.zeros(3))


def test_file_that_is_none_is_named(tmp_path):
    for path in (tmp_path, tmp_path / "none.csv", tmp_path / ("x" * 300)):
        with pytest.raises(ModelError, match="cannot read"):
            read_record(path, RecordChoice())


@pytest.mark.parametrize(("first", "last"), [(1.0, 12.0), (12.0, 1.0), (3.0, 3.0)])
@pytest.mark.parametrize(("spacing", "method"), [("linear", "linear"), ("logarithmic", "logarithmic")])
def test_sweep_is_the_chirp_of_scipy(first, last, spacing, method):
    sweep = Sweep(amplitude=2.5, first=first, last=last, start=0.5, end=4.5, spacing=spacing)
    t = np.linspace(0, 6, 3001)
    inside = (t >= 0.5) & (t <= 4.5)
    expected = np.where(inside, 2.5 * chirp(t - 0.5, first, 4.0, last, method=method, phi=-90), 0.0)
    assert sweep(t) == pytest.approx(expected, abs=1e-9)


def test_taper_rises_and_falls_by_half_a_cosine():
    t = np.array([0.0, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0])
    assert tapered(t, 1.0, 6.0, 1.0, 2.0) == pytest.approx([0, 0, 0.5, 1, 1, 1, 0.5, 0, 0])
    sweep = {"first": 2.0, "last": 5.0, "end": 6.0}
    assert Sweep(**sweep, taper=1.0)(t) == pytest.approx(tapered(t, 0.0, 6.0, 1.0, 1.0) * Sweep(**sweep)(t))


def test_noise_has_its_band_its_mean_square_and_its_phases():
    noise = Noise(seed=7, rms=3.0, low=1.0, high=10.0, start=0.5, end=20.5)
    t = 0.5 + np.arange(2000) * 0.01
    values = noise(t)
    assert np.sqrt(np.mean(values**2)) == pytest.approx(3.0, rel=1e-12)
    spectrum = 2 * np.fft.rfft(values) / len(t)
    band = np.arange(20, 201)  # k / 20 s
    assert np.abs(spectrum[band]) == pytest.approx(3.0 * np.sqrt(2 / len(band)), rel=1e-9)
    assert np.max(np.abs(np.delete(spectrum, band))) < 1e-12
    # The first phase by the published stream of PCG64 with this seed.
    assert np.angle(spectrum[20]) % (2 * np.pi) == pytest.approx(2 * np.pi * np.random.Generator(np.random.PCG64(7)).random(), rel=1e-9)
    assert np.all(noise(np.array([0.4999, 20.5001])) == 0)
    assert not np.allclose(Noise(seed=8, low=1.0, high=10.0, end=20.0)(t), Noise(seed=9, low=1.0, high=10.0, end=20.0)(t))


FROZEN = [0.034086086042498326, 0.4941064402055059, 0.33235951135265457]
"""The sum of 46 cosines of the docstring, written out apart from the class."""


def test_noise_does_not_change_between_releases():
    values = Noise(seed=42, low=0.5, high=5.0, end=10.0, rise=2.0, decay=3.0)(np.array([1.0, 5.0, 9.0]))
    assert values == pytest.approx(FROZEN, rel=1e-9)


@pytest.mark.parametrize(
    ("kind", "values", "words"),
    [
        (Sweep, {"first": 0.0, "last": 1.0, "end": 1.0}, r"first: expected > 0 and <= 1e\+12 Hz"),
        (Sweep, {"first": 1.0, "last": 1.0, "end": 0.0}, "end: expected > start"),
        (Sweep, {"first": 1.0, "last": 2.0, "end": 1.0, "taper": 0.6}, "room for a rise"),
        (Noise, {"seed": -1, "high": 5.0, "end": 1.0}, "seed: expected >= 0"),
        (Noise, {"seed": 1, "high": 0.05, "end": 1.0}, "expected >= low"),
        (Noise, {"seed": 1, "low": 0.2, "high": 0.3, "end": 1.0}, "holds no multiple"),
        (Noise, {"seed": 1, "high": 1e9, "end": 1.0}, "at most 20000"),
    ],
)
def test_signals_that_cannot_be_are_refused(kind, values, words):
    with pytest.raises(ModelError, match=words):
        kind(**values)
