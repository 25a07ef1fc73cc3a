"""Where pages of evidence are written."""

from pathlib import Path

import pytest

from uplift.drivers.evidence.pages import command_line, page_path


@pytest.mark.parametrize(
    ("project", "place"),
    [("", "page.md"), ('[project]\nname = "another"\n', "page.md"), ('[project]\nname = "uplift-fem"\n', "docs/page.md")],
)
def test_only_the_docs_of_a_checkout_are_written_to(tmp_path, monkeypatch, project, place):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "docs").mkdir()
    if project:
        (tmp_path / "pyproject.toml").write_text(project, encoding="utf-8")
    assert page_path("page.md") == Path(place)
    assert command_line("survey", Path(place), "page.md", "--quick") == "python3 -m drivers survey --quick"
    assert command_line("survey", Path("elsewhere.md"), "page.md") == "python3 -m drivers survey --out elsewhere.md"
    assert command_line("cost", Path(place), "page.md", scene=Path("other.toml")) == "python3 -m drivers cost other.toml"


@pytest.mark.parametrize("peers", [False, True])
def test_a_page_of_another_folder_is_not_written_into_its_docs(tmp_path, monkeypatch, peers):
    """The command that chooses between two pages chooses their place as the others do."""
    from uplift.drivers.cli import parser
    from uplift.drivers.evidence.scaling import scaling

    monkeypatch.chdir(tmp_path)
    written = []
    for name in ("scaling", "beside_opensees"):
        monkeypatch.setattr(scaling, name, lambda path, scene, out, *, quick: written.append(out))
    options = parser().parse_args(["scale", *["--peers"] * peers])
    monkeypatch.setattr("uplift.drivers.process.launched", lambda: False)
    assert options.command(options, 0.0) == 0
    assert written == [Path("scaling-peers.md" if peers else "scaling.md")]
