import json
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import configspace
from configspace import CacheError, Grid, PermissibleSpace

GRID = Grid(16, 24)


@pytest.fixture(scope="module")
def space() -> PermissibleSpace:
    return configspace.build_space(
        configspace.load_vehicle("ift-four-steered"), GRID, cache=False
    )


@pytest.fixture(scope="module")
def content(space: PermissibleSpace) -> bytes:
    return configspace.dump_space(space)


def assert_same(one: PermissibleSpace, other: PermissibleSpace) -> None:
    assert one.header == other.header
    for name, array in vars(one.tables).items():
        np.testing.assert_array_equal(array, getattr(other.tables, name))
        assert array.dtype == getattr(other.tables, name).dtype


def described(content: bytes) -> tuple[dict[str, Any], dict[str, Any], bytes]:
    """The parts of a sheet: safetensors' header, its description, the tensors."""
    size = int.from_bytes(content[:8], "little")
    header = json.loads(content[8 : 8 + size])
    return header, json.loads(header["__metadata__"]["omniplan"]), content[8 + size :]


def forged(content: bytes, **changes: Any) -> bytes:
    """The same tensors under another description; None takes a key away."""
    header, description, tensors = described(content)
    for key, value in changes.items():
        if value is None:
            del description[key]
        else:
            description[key] = value
    header["__metadata__"]["omniplan"] = json.dumps(description)
    text = json.dumps(header).encode()
    return len(text).to_bytes(8, "little") + text + tensors


@pytest.mark.parametrize("name", configspace.catalog())
def test_round_trip_without_the_vehicle(name: str, tmp_path: Path) -> None:
    space = configspace.build_space(configspace.load_vehicle(name), GRID, cache=False)
    path = tmp_path / "sheet.safetensors"
    space.save(path)
    again = configspace.load_space(str(path))
    assert again.vehicle is None
    assert_same(space, again)
    assert_same(space, configspace.parse_space(configspace.dump_space(space)))


def test_dumping_twice_gives_the_same_bytes(space: PermissibleSpace) -> None:
    assert configspace.dump_space(space) == configspace.dump_space(space)


def test_size_does_not_depend_on_the_number_of_wheels() -> None:
    def size(count: int) -> int:
        wheels = [
            {"id": f"w{i:03}", "type": "steered", "x": 1, "y": 0.01 * i, "max_speed": 1}
            for i in range(count)
        ]
        vehicle = configspace.vehicle_from_data({"name": "v", "wheels": wheels})
        sheet = configspace.build_space(vehicle, Grid(40, 72), cache=False)
        return len(configspace.dump_space(sheet))

    # Only the names of the wheels are kept.
    assert size(100) - size(2) < 98 * 20


def test_saving_replaces_an_older_file(space: PermissibleSpace, tmp_path: Path) -> None:
    path = tmp_path / "sheet"
    path.write_text("old")
    space.save(path)
    assert_same(space, configspace.load_space(path))
    assert os.listdir(tmp_path) == ["sheet"]


@contextmanager
def failing(monkeypatch: pytest.MonkeyPatch, name: str) -> Iterator[None]:
    def fail(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(f"configspace.files.os.{name}", fail)
        yield


@pytest.mark.parametrize("step", ["fsync", "replace"])
def test_a_failed_save_leaves_the_older_file_and_nothing_else(
    space: PermissibleSpace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str
) -> None:
    path = tmp_path / "sheet"
    path.write_text("old")
    with failing(monkeypatch, step), pytest.raises(CacheError, match="No space left"):
        space.save(path)
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["sheet"]


def test_places_that_cannot_be_written_are_plain_errors(
    space: PermissibleSpace, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    for path in (
        tmp_path,
        tmp_path / "missing" / "sheet",
        tmp_path / "file" / "sheet",
        tmp_path / ("x" * 300),
        Path("/proc/nowhere/sheet"),
    ):
        with pytest.raises(CacheError, match="cannot be written"):
            space.save(path)
    assert os.listdir(tmp_path) == ["file"]


def test_a_saved_sheet_has_the_permissions_of_any_new_file(
    space: PermissibleSpace, tmp_path: Path
) -> None:
    space.save(tmp_path / "sheet")
    (tmp_path / "plain").write_text("")
    modes = [stat.S_IMODE((tmp_path / n).stat().st_mode) for n in ("sheet", "plain")]
    assert modes[0] == modes[1]


def test_truncated_sheets_are_damaged(content: bytes) -> None:
    lengths = {int(x) for x in np.linspace(0, len(content) - 1, 200)}
    for length in lengths | set(range(20)):
        with pytest.raises(CacheError):
            configspace.parse_space(content[:length])


def test_longer_sheets_are_damaged(content: bytes) -> None:
    for more in (b"\0", b"x" * 100, content):
        with pytest.raises(CacheError):
            configspace.parse_space(content + more)


def flip(content: bytes, position: int, mask: int) -> bytes:
    damaged = bytearray(content)
    damaged[position] ^= mask
    return bytes(damaged)


def assert_damaged_or_equal(space: PermissibleSpace, content: bytes) -> None:
    try:
        found = configspace.parse_space(content)
    except CacheError:
        return
    assert_same(space, found)


def test_a_flipped_byte_in_the_header_never_gives_a_wrong_sheet(
    space: PermissibleSpace, content: bytes
) -> None:
    size = 8 + int.from_bytes(content[:8], "little")
    rng = np.random.default_rng(0)
    for position in range(size):
        for mask in (0x01, 0x20, int(rng.integers(1, 256))):
            assert_damaged_or_equal(space, flip(content, position, mask))


@cache
def small_sheet() -> tuple[PermissibleSpace, bytes]:
    vehicle = configspace.load_vehicle("differential")
    space = configspace.build_space(vehicle, Grid(8, 8), cache=False)
    return space, configspace.dump_space(space)


@given(data=st.data())
@settings(max_examples=150, deadline=None)
def test_flipped_bytes_anywhere_never_give_a_wrong_sheet(data: st.DataObject) -> None:
    space, content = small_sheet()
    for _ in range(data.draw(st.integers(1, 3))):
        position = data.draw(st.integers(0, len(content) - 1))
        content = flip(content, position, data.draw(st.integers(1, 255)))
    assert_damaged_or_equal(space, content)


def test_every_flipped_bit_of_the_tables_is_found(content: bytes) -> None:
    size = 8 + int.from_bytes(content[:8], "little")
    for position in np.random.default_rng(0).integers(size, len(content), 200):
        with pytest.raises(CacheError, match="checksum"):
            configspace.parse_space(flip(content, int(position), 1))


@pytest.mark.parametrize("key", ["format_version", "algorithm_version"])
@pytest.mark.parametrize("version", ["0", "99", "", None])
def test_other_versions_are_named(
    content: bytes, key: str, version: str | None
) -> None:
    with pytest.raises(CacheError, match=key):
        configspace.parse_space(forged(content, **{key: version}))


@pytest.mark.parametrize(
    "changes",
    [
        {"format": "something else"},
        {"format": None},
        {"checksum": "0"},
        {"checksum": None},
        {"header": None},
        {"header": "{}"},
    ],
)
def test_other_metadata_is_no_sheet(content: bytes, changes: dict[str, Any]) -> None:
    with pytest.raises(CacheError):
        configspace.parse_space(forged(content, **changes))


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\0" * 8,
        b"\xff" * 64,
        b"PK\x03\x04" + b"\0" * 100,
        b"name: agv\nwheels: []\n",
        (2).to_bytes(8, "little") + b"{}",
        (4).to_bytes(8, "little") + b"null",
        (2).to_bytes(8, "little") + b"[]",
        (21).to_bytes(8, "little") + b'{"__metadata__":null}',
        (19).to_bytes(8, "little") + b'{"__metadata__":[]}',
        (9000).to_bytes(8, "little") + b"[" * 9000,
    ],
)
def test_other_files_are_no_sheets(content: bytes) -> None:
    with pytest.raises(CacheError):
        configspace.parse_space(content)


def test_files_that_cannot_be_read_are_plain_errors(tmp_path: Path) -> None:
    (tmp_path / "empty").write_bytes(b"")
    for path in (tmp_path, tmp_path / "missing", tmp_path / "empty"):
        with pytest.raises(CacheError):
            configspace.load_space(path)


def self_consistent(content: bytes, **changes: Any) -> bytes:
    """A sheet of wrong content whose checksum is right, as a broken writer makes it."""
    from safetensors import numpy as safetensors  # noqa: TID251

    from configspace.storage import _checksum

    _, description, _ = described(content)
    tensors = safetensors.load(content)
    for name, change in changes.items():
        if name == "header":
            description["header"] = change(description["header"])
        elif change is None:
            del tensors[name]
        else:
            tensors[name] = np.ascontiguousarray(change(tensors[name]))
    description["checksum"] = _checksum(description["header"], tensors)
    metadata = {"omniplan": json.dumps(description)}
    return bytes(safetensors.save(tensors, metadata=metadata))


def test_sheets_can_be_forged_for_these_tests(
    space: PermissibleSpace, content: bytes
) -> None:
    assert_same(space, configspace.parse_space(self_consistent(content)))
    assert_same(space, configspace.parse_space(forged(content)))


@pytest.mark.parametrize(
    "changes",
    [
        {"load": None},
        {"load": lambda x: x[:, :-1]},
        {"load": lambda x: x[0]},
        {"load": lambda x: x.astype(np.float64)},
        {"load": lambda x: x * np.float32(np.nan)},
        {"load": lambda x: -x},
        {"load": lambda x: x * 0},
        {"state": lambda x: x[:-1]},
        {"state": lambda x: x + 7},
        {"reason": lambda x: x[:, :, :3]},
        {"header": lambda h: h.replace('"n_kappa": 16', '"n_kappa": 20')},
        {"header": lambda h: h.replace('"n_kappa": 16', '"n_kappa": 17')},
        {"header": lambda h: h.replace('"n_kappa": 16', '"n_kappa": "16"')},
        {"header": lambda h: h.replace('"line_beta": null', '"line_beta": 0.0')},
        {"header": lambda h: h.replace('"kappa_g": ', '"kappa_g": -')},
        {"header": lambda h: h.replace('"kappa_g": ', '"kappa_g": NaN, "x": ')},
        {"header": lambda _: "[]"},
        {"header": lambda _: "{}"},
        {"header": lambda _: "3"},
        {"header": lambda _: "not json"},
    ],
    ids=[
        "no-load",
        "short-load",
        "flat-load",
        "double-load",
        "nan-load",
        "negative-load",
        "zero-load",
        "short-state",
        "odd-state",
        "short-reason",
        "other-grid",
        "bad-grid",
        "text-grid",
        "line-beta",
        "negative-kappa-g",
        "nan-kappa-g",
        "list-header",
        "empty-header",
        "number-header",
        "text-header",
    ],
)
def test_sheets_of_impossible_content_are_damaged(
    content: bytes, changes: dict[str, Any]
) -> None:
    with pytest.raises(CacheError):
        configspace.parse_space(self_consistent(content, **changes))
