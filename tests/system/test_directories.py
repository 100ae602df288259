"""Whether a directory exists, also where it may not be looked at."""

from pathlib import Path

import pytest

from radarsim.system.directories import is_directory


def test_a_directory_that_may_not_be_looked_at_is_not_taken_for_none(monkeypatch, tmp_path):
    assert is_directory(tmp_path)
    assert not is_directory(tmp_path / "none")
    (tmp_path / "file").touch()
    assert not is_directory(tmp_path / "file")
    assert not is_directory(tmp_path / "file" / "below")

    def closed(*_, **__):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "stat", closed)
    with pytest.raises(PermissionError):
        is_directory(tmp_path)
