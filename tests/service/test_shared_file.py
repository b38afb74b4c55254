"""Where the large files of a job lie for its process."""

import os
from pathlib import Path

import pytest

from jshell.io import zip_files
from jshell.service import shared_file


def test_files_are_seen_where_they_lie_and_written_over_by_the_next_job(monkeypatch):
    monkeypatch.setattr(shared_file, "MAX_KEPT_BYTES", 3)
    made = shared_file.SharedFile()
    first = made.write([("a", b"12345"), ("none", b""), ("b", b"678")])
    assert [(name, bytes(ref.view())) for name, ref in first] == [("a", b"12345"), ("none", b""), ("b", b"678")]
    with pytest.raises(TypeError):
        first[0][1].view()[0] = 0  # read-only
    path = Path(first[0][1].path)
    second = made.write([("c", b"9")])
    assert bytes(second[0][1].view()) == b"9"
    assert path.stat().st_size == 3  # what a large job took is given back
    made.close()
    assert not path.exists()


def test_a_full_disk_says_so_and_leaves_a_file_that_works(monkeypatch):
    made = shared_file.SharedFile()
    write = made._file.write

    def some(content) -> int:
        if len(content) > 4:
            return write(content[:4])  # as a disk does before it is full
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(made._file, "write", some)
    with pytest.raises(OSError, match="No space"):
        made.write([("a", b"1234567")])
    monkeypatch.undo()
    assert bytes(made.write([("a", b"1234567")])[0][1].view()) == b"1234567"
    made.close()


def test_an_archive_is_read_where_it_lies():
    content = zip_files.pack_files([("a.csv", b"first"), ("b.csv", os.urandom(10_000))])
    assert zip_files.files("many.zip", memoryview(content)) == zip_files.files("many.zip", content)
    with pytest.raises(OSError, match="before"):
        zip_files._Looked(content).seek(-1)
    with pytest.raises(zip_files.BadFile, match="no archive"):
        zip_files.files("many.zip", memoryview(b"no zip"))
