"""The folder of compiled code: damage is noticed before numba reads it, and what others add is not taken for damage."""

import os
from pathlib import Path

import pytest

from manipnet.common.kernel_cache import MANIFEST, check_cache, seal_cache

WHOLE = b"\x80\x05C\x0dcompiled code."
"""The pickle of some bytes."""
DAMAGED = [b"", WHOLE[:1], WHOLE[:-3], WHOLE[:8] + b".", WHOLE + WHOLE[:9], b"x" * len(WHOLE), bytes(len(WHOLE))]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A sealed cache of two functions."""
    for name in ("a.f-1.py311.nbi", "a.f-1.py311.1.nbc", "a.f-1.py311.2.nbc", "b.g-2.py311.nbi", "b.g-2.py311.1.nbc"):
        path = tmp_path / "module_1" / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(WHOLE)
    seal_cache(tmp_path)
    return tmp_path


def names(folder: Path) -> set[str]:
    return {path.name for path in (folder / "module_1").iterdir()}


G = {"b.g-2.py311.nbi", "b.g-2.py311.1.nbc"}


def test_what_is_whole_stays(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    check_cache(folder)
    assert len(names(folder)) == 5
    assert caplog.text == ""


@pytest.mark.parametrize("name", ["a.f-1.py311.nbi", "a.f-1.py311.2.nbc"])
@pytest.mark.parametrize("content", DAMAGED)
def test_all_files_of_a_function_go_if_one_is_damaged(
    folder: Path, caplog: pytest.LogCaptureFixture, name: str, content: bytes
) -> None:
    (folder / "module_1" / name).write_bytes(content)
    check_cache(folder)
    assert names(folder) == G
    assert "1 files of compiled code" in caplog.text
    assert "are damaged" in caplog.text


@pytest.mark.parametrize("name", ["a.f-1.py311.nbi", "a.f-1.py311.2.nbc"])
def test_a_folder_in_the_place_of_a_file_goes_too(folder: Path, name: str) -> None:
    path = folder / "module_1" / name
    path.unlink()
    path.mkdir()
    (path / "more").write_bytes(WHOLE)
    check_cache(folder)
    assert names(folder) == G


def test_a_flipped_bit_is_noticed_although_the_time_is_that_of_the_manifest(folder: Path) -> None:
    path = folder / "module_1" / "a.f-1.py311.1.nbc"
    stat = path.stat()
    path.write_bytes(WHOLE.replace(b"c", b"b"))
    os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))
    check_cache(folder)
    assert names(folder) == G


def test_what_another_process_has_added_or_replaced_since_stays(folder: Path) -> None:
    (folder / "module_1" / "a.f-1.py311.nbi").write_bytes(WHOLE + WHOLE)
    (folder / "module_1" / "a.f-1.py311.3.nbc").write_bytes(WHOLE)
    check_cache(folder)
    assert len(names(folder)) == 6
    seal_cache(folder)
    check_cache(folder)
    assert len(names(folder)) == 6


@pytest.mark.parametrize("content", [b"", b"{", b"[1]", b'{"a": 3}'])
def test_a_damaged_manifest_is_written_again(folder: Path, caplog: pytest.LogCaptureFixture, content: bytes) -> None:
    whole = (folder / MANIFEST).read_bytes()
    (folder / MANIFEST).write_bytes(content)
    check_cache(folder)
    assert len(names(folder)) == 5
    assert "damaged" in caplog.text
    seal_cache(folder)
    assert (folder / MANIFEST).read_bytes() == whole


def test_an_empty_folder_is_fine(tmp_path: Path) -> None:
    check_cache(tmp_path)
    seal_cache(tmp_path)
    check_cache(tmp_path)
