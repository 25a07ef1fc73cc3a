"""Records as spreadsheets, Matlab, Fortran and recorders write them: each is the same table, or is refused by its line."""

import numpy as np
import pytest

from uplift.forms.loads.records import RecordChoice, read_record
from uplift.forms.loads.units import plain
from uplift.meshes.checked import ModelError

TIMES = [0.0, 0.01, 0.02]
VALUES = [0.0, -1.5, 250.0]

SAME = {
    "comma": "t,a\n0,0\n0.01,-1.5\n0.02,250\n",
    "blanks": "   0.00   0.0000e+00\n   0.01  -1.5000e+00\n   0.02   2.5000e+02\n",
    "tabs and blanks": "t\ta\n 0.00\t 0.0\n 0.01\t-1.5\n 0.02\t 250.0\t\n",
    "tabs before": "\tt\ta\n\t0.00\t0\n\t0.01\t-1.5\n\t0.02\t250\n",
    "decimal comma": "Zeit;a\n0,00;0\n0,01;-1,5\n0,02;2,5e2\n",
    "decimal comma and tab": "Zeit\ta\n0\t0\n0,01\t-1,5\n0,02\t250\n",
    "decimal comma and blanks": "0,00 0,0\n0,01 -1,5\n0,02 250,0\n",
    "quoted decimal comma": '"t","a"\n"0,00","0"\n"0,01","-1,5"\n"0,02","250"\n',
    "quotes": '"Time";"Acc"\n"0.00";"0"\n"0.01";"-1.5"\n"0.02";"250"\n',
    "single quotes": "'t','a'\n'0','0'\n'0.01','-1.5'\n'0.02','250'\n",
    "line feeds of old Macs": "t,a\r0,0\r0.01,-1.5\r0.02,250\r",
    "DOS": "t,a\r\n0,0\r\n0.01,-1.5\r\n0.02,250\r\n\x1a",
    "D exponents": "  0.0D+00  0.0D0\n  1.0D-02 -1.5D+00\n  2.0d-02  2.5d+02\n",
    "Fortran without the letter": "0.0 0.0\n0.01 -1.5\n2.0-002 2.5+002\n",
    "leading points": ".00,.0\n.01,-1.5\n.02,+250.\n",
    "title, names, units": "Station Kobe 1995, component NS\nTime,Acc\n(s),(m/s2)\n0,0\n0.01,-1.5\n0.02,250\n",
    "title in blanks": "Kobe 1995 NS\nTime (s)  Acc (m/s2)\n0 0\n0.01 -1.5\n0.02 250\n",
    "numpy": "# t [s] a [m/s^2]\n0.0e+00 0.0e+00\n1.0e-02 -1.5e+00\n2.0e-02 2.5e+02\n",
    "Matlab": "% t a\n0 0\n0.01 -1.5 % first\n0.02 250\n",
    "Fortran remarks": "! t a\n 0 0\n 0.01 -1.5 ! first\n 0.02 250\n",
    "empty columns": "t;a;;\n0;0;;\n;;;\n0.01;-1.5;;\n0.02;250;;\n",
    "minus of a word processor": "t,a\n0,0\n0.01,\N{MINUS SIGN}1.5\n0.02,250\n",
    "blanks that do not break": "t;a\n0;0\n\xa00.01;\xa0-1.5\n0.02;250\n",
    "times second": "a [m/s2],time [s]\n0,0\n-1.5,0.01\n250,0.02\n",
    "page feed": "t,a\n0,0\n\f0.01,-1.5\n0.02,250\n",
    "commas and blanks": "t, a\n0, 0\n0.01, -1.5\n0.02, 250\n",
}


def table_of(folder, text, encoding="utf-8", **choice):
    path = folder / "record.txt"
    path.write_bytes(text.encode(encoding))
    return read_record(path, RecordChoice(**choice))


@pytest.mark.parametrize("text", SAME.values(), ids=SAME)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
def test_what_programs_write_is_the_same_table(tmp_path, text, encoding):
    table = table_of(tmp_path, text, encoding)
    assert table.times == pytest.approx(TIMES, rel=1e-15, abs=0) and table.values == pytest.approx(VALUES, rel=1e-15, abs=0)
    assert table.remarks == ()


@pytest.mark.parametrize("encoding", ["latin-1", "cp1252", "utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be"])
def test_encodings(tmp_path, encoding):
    table = table_of(tmp_path, "Zeit [s];Böden [m/s²]\n0;0\n0,01;-1,5\n0,02;250\n", encoding)
    assert table.times == pytest.approx(TIMES) and table.values == pytest.approx(VALUES) and table.remarks == ()


SLIPS = {
    "letters for zeros": ("0.00,0.0OO\n0.01,1\n0.02,2\n", "line 1"),
    "letters in the time": ("O.00,0.0\n0.01,1\n0.02,2\n", "line 1"),
    "two points": ("t,a\n0.0,0..5\n0.01,1\n0.02,2\n", "line 2"),
    "an empty cell": ("0.00,\n0.01,1\n0.02,2\n", "line 1"),
    "text for a value": ("0.00,n/a\n0.01,1\n0.02,2\n", "line 1"),
    "a number of rows": ("t,a\n3\n0,0\n0.01,1\n0.02,2\n", "line 2"),
    "a value missing": ("0,0\n0.01\n0.02,2\n", "line 2"),
    "a value too many": ("0,0\n0.01,1,2\n0.02,2\n", "line 2"),
    "empty in the middle": ("0,0\n0.01,\n0.02,2\n", "line 2"),
    "asterisks of Fortran": ("0.0 0.0\n0.01 ******\n0.02 2.0\n", "line 2: expected finite"),
    "not a number of Matlab": ("0 0\n0.01 NaN\n0.02 2\n", "line 2: expected finite"),
    "infinite": ("0 NaN\n0.01 1\n0.02 2\n", "line 1: expected finite"),
    "beyond a double": ("0 0\n0.01 1e999\n0.02 2\n", "line 2: expected finite"),
    "point and comma": ("0,00;0,5\n0,01;1.5\n0,02;2,5\n", "line 2"),
    "decimal comma between commas": ("0,01,1,5\n0,02,1,6\n", "4 columns"),
    "thousands": ("0.0;1,000.5\n0.01;1\n", "line 1"),
    "underscores": ("0,0\n0.01,1_0\n0.02,2\n", "line 2"),
    "dates": ("t,a\n2011-03-11 14:46:00,1\n2011-03-11 14:46:01,2\n", "at least two lines"),
    "a footer": ("0,0\n0.01,1\nend of file\n", "line 3"),
    "heading again": ("t,a\n0,0\n0.01,1\nt,a\n0.02,2\n", "line 4"),
    "one column": ("a\n0.1\n0.2\n", "line 2"),
    "no numbers": ("hello\nworld\n", "at least two lines"),
    "bytes": ("0,0\n\x00\x00\x00\n", "not a text file"),
    "values of PEER, five a line": ("PEER NGA\n  1E-3 2E-3 3E-3 4E-3 5E-3\n  1E-3 2E-3 3E-3 4E-3 5E-3\n", "5 columns"),
}


@pytest.mark.parametrize(("text", "words"), SLIPS.values(), ids=SLIPS)
def test_slips_are_named_by_their_line(tmp_path, text, words):
    with pytest.raises(ModelError, match=words) as error:
        table_of(tmp_path, text)
    assert len(str(error.value)) < 300 + len(str(tmp_path)) and len(str(error.value).splitlines()) == 1


UNITS = {  # heading of the values -> size in m/s2, by the definition of the unit
    "Acceleration [g]": 9.80665, "acc (g)": 9.80665, "a/g": 9.80665, "acc_g": 9.80665, "Acc in g": 9.80665, "A (G)": 9.80665,
    "a [cm/s2]": 0.01, "a [cm/s^2]": 0.01, "a (cm/s/s)": 0.01, "a (cm/sec/sec)": 0.01, "a [cm/sec2]": 0.01, "a [Gal]": 0.01, "gal": 0.01,
    "a [cm s-2]": 0.01, "a [cm·s⁻²]": 0.01, "a [mm/s²]": 0.001, "a [mg]": 9.80665e-3, "a [%g]": 0.0980665, "a [in/s2]": 0.0254,
    "a [ft/s2]": 0.3048, "a [nm/s**2]": 1e-9, "Acc (NS) (g)": 9.80665, "units: g": 9.80665,
    "a [m/s2]": 1.0, "a (m/s^2)": 1.0, "a [m/s**2]": 1.0, "a (m/(s^2))": 1.0, "a [m.s-2]": 1.0, "a [M/S**2]": 1.0, "a": 1.0, "a (NS)": 1.0,
    "a [corrected]": 1.0,
}


@pytest.mark.parametrize(("heading", "size"), UNITS.items())
@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_unit_of_a_heading(tmp_path, heading, size, separator):
    text = "\n".join(separator.join(row) for row in (("t", heading), ("0", "0"), ("0.01", "2")))
    table = table_of(tmp_path, text)
    assert table.values == pytest.approx([0.0, 2 * size], rel=1e-14)
    assert [found.severity for found in table.remarks] == ["note"] * (size != 1.0)
    # What the scene says holds, and a difference is said.
    other = "cm/s2" if size == 9.80665 else "g"
    table = table_of(tmp_path, text, unit=other)
    assert table.values[1] == pytest.approx({"cm/s2": 0.02, "g": 2 * 9.80665}[other])
    named = size != 1.0 or "s" in heading.replace("corrected", "").replace("NS", "").lower()
    assert [(found.key, found.severity) for found in table.remarks] == [("record", "doubt")] * named


@pytest.mark.parametrize("line", ["# acceleration in units of g", "# t [s], a [g]", "ACCELERATION TIME SERIES IN UNITS OF G", "# unit: g"])
def test_unit_in_a_line_before_the_numbers(tmp_path, line):
    table = table_of(tmp_path, f"{line}\n0 0\n0.01 2\n")
    assert table.values[1] == pytest.approx(2 * 9.80665) and "as its heading says" in table.remarks[0].text


def test_lines_that_name_several_units_name_none(tmp_path):
    assert table_of(tmp_path, "# velocity (gal), shown in (g)\n0 0\n0.01 2\n").values[1] == 2.0


def test_units_in_a_line_of_their_own(tmp_path):
    assert table_of(tmp_path, "t;a\ns;g\n0;0\n0.01;2\n").values[1] == pytest.approx(2 * 9.80665)


@pytest.mark.parametrize(("heading", "size"), [("t [ms]", 1e-3), ("Time (msec)", 1e-3), ("time [min]", 60.0), ("t/ms", 1e-3)])
def test_unit_of_the_times(tmp_path, heading, size):
    table = table_of(tmp_path, f"{heading},a\n0,0\n10,2\n")
    assert table.times[1] == pytest.approx(10 * size) and table.remarks[0].severity == "note"


@pytest.mark.parametrize("heading", ["v [m/s]", "u [mm]", "a [counts]", "F [kN]"])
def test_what_is_no_acceleration_is_refused_unless_the_scene_says_its_unit(tmp_path, heading):
    text = f"t,{heading}\n0,0\n0.01,2\n"
    with pytest.raises(ModelError, match="no unit of acceleration") as error:
        table_of(tmp_path, text)
    assert error.value.key == "unit"
    assert [found.severity for found in table_of(tmp_path, text, unit="m/s2").remarks] == ["doubt"]
    assert table_of(tmp_path, text, acceleration=False).values[1] == 2.0


def test_a_scale_that_may_be_the_unit(tmp_path):
    text = "t,a [g]\n0,0\n0.01,2\n"
    assert table_of(tmp_path, text, scale=9.81).values[1] == pytest.approx(19.62)
    with pytest.raises(ModelError, match="scale = 2 may or may not") as error:
        table_of(tmp_path, text, scale=2.0)
    assert error.value.key == "unit"
    assert table_of(tmp_path, text, scale=2.0, unit="g").values[1] == pytest.approx(4 * 9.80665)


def test_unused_columns_may_hold_anything(tmp_path):
    table = table_of(tmp_path, "t,a,remark\n0,1,\n0.01,2,peak\n0.02,3,n/a\n", column="a")
    assert table.values.tolist() == [1.0, 2.0, 3.0]


def test_plain_leaves_other_words_alone():
    assert [plain(word) for word in ("NS", "corrected", "m")] == ["ns", "corrected", "m"]


def test_a_long_line_of_brackets_is_no_work(tmp_path):
    with pytest.raises(ModelError, match="at least two lines"):
        table_of(tmp_path, "(" * 1_000_000 + "\n" + '"' * 1_000_000)


def test_a_record_of_many_rows(tmp_path):
    times = 0.005 * np.arange(100_000)
    lines = "\n".join(f"{t:.3f} {np.sin(t):.6e}" for t in times)
    assert table_of(tmp_path, lines).times == pytest.approx(times, abs=1e-9)
