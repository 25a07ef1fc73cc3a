import pytest

from uplift.drivers.evidence import verify as module


@pytest.mark.complex
def test_verify_fails_when_a_value_misses(tmp_path, monkeypatch, comm, capsys):
    """The comparison is not a formality: with another published value it fails and marks the row."""
    text = module.PUBLISHED.read_text(encoding="utf-8").replace("-4.58502e-2", "-4.58512e-2")
    (tmp_path / "other.csv").write_text(text, encoding="utf-8")
    other = module.published_values(tmp_path / "other.csv")
    monkeypatch.setattr(module, "published_values", lambda: other)
    for method in ("transient", "time-frequency"):
        (tmp_path / method).mkdir()
    assert module.verify(comm, tmp_path, plots=False) is False
    printed = capsys.readouterr().out
    assert [line.split()[4] for line in printed.splitlines() if line.endswith("MISSED")] == ["-4.58512e-2"]
    assert "FAILED" in printed
