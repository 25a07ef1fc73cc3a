"""The comparison of recorded platforms: what counts as the same number."""

import json

import pytest

from uplift.drivers.evidence.platforms.page import compared, platforms, tables
from uplift.meshes.checked import ModelError

PAGE = """# A page

| case | P3 [m] | transient - Laplace |
| --- | ---: | ---: |
| reference | {value} | {difference} |

Text with 1.0 in it.

| mesh | dofs | verdict |
|---|---:|---|
| 4 x 8 | 1,156 | {verdict} |
"""

VERIFY = "transient          1    2.33  P3.DX      -4.58502e-2  {value}     1.4e-07\nseconds: mesh 0.12 s\n"


def page(folder, name, value="-0.0567170", difference="2.4e-11", verdict="holds"):
    path = folder / name
    path.write_text(PAGE.format(value=value, difference=difference, verdict=verdict))
    return path


def test_all_cells_of_all_tables_are_read(tmp_path):
    assert tables(page(tmp_path, "a.md")) == [
        ("reference", "case", "reference"), ("reference", "P3 [m]", "-0.0567170"), ("reference", "transient - Laplace", "2.4e-11"),
        ("4 x 8", "mesh", "4 x 8"), ("4 x 8", "dofs", "1,156"), ("4 x 8", "verdict", "holds"),
    ]


@pytest.mark.parametrize(
    ("changes", "equal", "last_digit", "apart"),
    [
        ({}, 4, 0, []),
        ({"difference": "9.9e-11"}, 4, 0, []),
        ({"value": "-0.0567171"}, 3, 1, []),
        ({"value": "-0.0567172"}, 3, 0, ["reference, P3 [m]: -0.0567170 and -0.0567172"]),
        ({"value": "-5.67170e-2"}, 3, 1, []),
        ({"value": "-"}, 3, 0, ["reference, P3 [m]: -0.0567170 and -"]),
        ({"verdict": "FAILS"}, 4, 0, ["4 x 8, verdict: holds and FAILS"]),
    ],
)
def test_numbers_agree_to_their_last_digit(tmp_path, changes, equal, last_digit, apart):
    found = compared(tables(page(tmp_path, "a.md")), tables(page(tmp_path, "b.md", **changes)))
    assert (found.equal, found.last_digit, found.apart) == (equal, last_digit, apart)


def test_a_row_that_is_missing_is_no_agreement(tmp_path):
    whole = tables(page(tmp_path, "a.md"))
    assert compared(whole, whole[:-3]).apart


def record(folder, value, here):
    folder.mkdir()
    for name in ("survey.md", "benchmarks.md", "stability.md"):
        page(folder, name, value)
    (folder / "verify.md").write_text(VERIFY.format(value=here))
    facts = {
        "system": "Debian GNU/Linux 12 (bookworm)", "versions": {"dolfinx": folder.name}, "processor": "a processor",
        "seconds": {"verify": 2.0 if folder.name == "one" else 3.0},
    }
    (folder / "platform.json").write_text(json.dumps(facts))
    return folder


def test_the_page_tells_whether_platforms_agree(tmp_path):
    one = record(tmp_path / "one", "1.50", "-4.585019340219056e-02")
    two = record(tmp_path / "two", "1.50", "-4.585019340777777e-02")
    three = record(tmp_path / "three", "1.70", "-4.585029340219056e-02")
    assert platforms([one, two], tmp_path / "page.md")
    assert "| verify | 1.00 | 1.50 |" in (tmp_path / "page.md").read_text()
    assert not platforms([one, three], tmp_path / "page.md")
    text = (tmp_path / "page.md").read_text()
    assert "- reference, P3 [m]: 1.50 and 1.70" in text and "1.50 |" in text
    with pytest.raises(ModelError, match="holds no platform"):
        platforms([one, tmp_path], tmp_path / "page.md")
    with pytest.raises(ModelError, match="two recorded platforms"):
        platforms([one], tmp_path / "page.md")
