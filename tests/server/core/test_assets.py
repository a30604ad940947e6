"""The asset store: reading, writing, access, and recovery after a crash."""

import asyncio
import hashlib
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from arcor2_hw.exceptions import Conflict, InvalidData, NotFound, StorageError
from arcor2_server.storage import Asset, AssetStore
from arcor2_server.storage.assets import TooLarge


async def chunks(*parts: bytes) -> AsyncIterator[bytes]:
    for part in parts:
        yield part


async def read(store: AssetStore, key: str) -> bytes:
    return b"".join([chunk async for chunk in store.read(store.info(key))])


def contents(directory: Path) -> list[bytes]:
    return sorted(path.read_bytes() for path in (directory / "content").rglob("*") if path.is_file())


@pytest.fixture
async def store(tmp_path: Path) -> AssetStore:
    return await AssetStore.open(tmp_path, limit=1_000_000)


async def test_assets_are_stored_across_restarts(store: AssetStore, tmp_path: Path) -> None:
    content = bytes(range(256)) * 3000
    asset = await store.put(
        chunks(content[:7], b"", content[7:]), "table.stl", file_name="t.stl", description="a table"
    )
    assert asset.size == len(content)
    assert asset.digest == hashlib.sha256(content).hexdigest()
    for each in (store, await AssetStore.open(tmp_path)):
        assert each.info("table.stl") == asset
        assert each.infos() == [asset]
        assert each.exists("table.stl")
        assert await read(each, "table.stl") == content


async def test_an_id_is_generated_when_none_is_given(store: AssetStore) -> None:
    first, second = await store.put(chunks(b"x")), await store.put(chunks(b"x"))
    assert first.id != second.id
    assert first.digest == second.digest


async def test_only_upsert_replaces(store: AssetStore, tmp_path: Path) -> None:
    first = await store.put(chunks(b"one"), "a")
    with pytest.raises(Conflict, match="'a'"):
        await store.put(chunks(b"two"), "a")
    assert await read(store, "a") == b"one"
    revision = store.revision
    second = await store.put(chunks(b"two"), "a", upsert=True)
    assert store.revision > revision
    assert (second.created, await read(store, "a")) == (first.created, b"two")
    assert second.modified > first.modified
    assert contents(tmp_path) == [b"two"]  # unreferenced content is removed


async def test_equal_content_is_stored_once_until_its_last_asset_is_deleted(store: AssetStore, tmp_path: Path) -> None:
    await store.put(chunks(b"same"), "a")
    await store.put(chunks(b"same"), "b")
    assert contents(tmp_path) == [b"same"]
    await store.delete("a")
    assert not store.exists("a")
    assert await read(store, "b") == b"same"
    await store.delete("b")
    assert contents(tmp_path) == []
    with pytest.raises(NotFound, match="'b'"):
        await store.delete("b")
    with pytest.raises(NotFound):
        store.info("b")


async def test_an_asset_deleted_during_reading_is_read_completely(store: AssetStore) -> None:
    content = b"0123456789" * 60_000
    await store.put(chunks(content), "a")
    reading = store.read(store.info("a"))
    got = await anext(reading)
    assert len(got) < len(content)
    await store.delete("a")
    async for chunk in reading:
        got += chunk
    assert got == content


async def test_an_oversized_upload_is_refused_and_leaves_nothing(store: AssetStore, tmp_path: Path) -> None:
    taken = 0

    async def endless() -> AsyncIterator[bytes]:
        nonlocal taken
        while True:
            taken += 100_000
            yield b"x" * 100_000

    with pytest.raises(TooLarge, match="1000000 bytes"):
        await store.put(endless(), "a")
    assert taken == 1_100_000  # reading stopped there
    assert not store.exists("a")
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]
    assert (await store.put(chunks(b"x" * 1_000_000), "a")).size == 1_000_000


@pytest.mark.parametrize("key", ["", "x" * 256, "a\nb", "a\0b", "\ud800"])
async def test_an_invalid_id_is_refused(store: AssetStore, key: str) -> None:
    with pytest.raises(InvalidData, match="printable"):
        await store.put(chunks(b"x"), key)


@pytest.mark.parametrize("key", ["../../x", "/etc/passwd", "a/b", ".", "..", "C:\\x", "con", "ž" * 255])
async def test_an_id_is_never_a_path(tmp_path: Path, key: str) -> None:
    store = await AssetStore.open(tmp_path / "data" / "assets")
    await store.put(chunks(b"content"), key)
    files = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert len(files) == 2
    assert all(path.parent.is_relative_to(tmp_path / "data" / "assets") for path in files)
    again = await AssetStore.open(tmp_path / "data" / "assets")
    assert await read(again, key) == b"content"


async def test_an_interrupted_upload_keeps_the_old_asset(store: AssetStore, tmp_path: Path) -> None:
    await store.put(chunks(b"old"), "a")

    async def broken() -> AsyncIterator[bytes]:
        yield b"new"
        raise ConnectionResetError

    with pytest.raises(ConnectionResetError):
        await store.put(broken(), "a", upsert=True)
    assert await read(store, "a") == b"old"
    assert contents(tmp_path) == [b"old"]
    assert not list((tmp_path / "incoming").iterdir())


async def test_one_of_two_simultaneous_uploads_is_refused(store: AssetStore) -> None:
    results = await asyncio.gather(*(store.put(chunks(str(n).encode()), "a") for n in range(8)), return_exceptions=True)
    (winner,) = [result for result in results if isinstance(result, Asset)]
    assert all(isinstance(result, Conflict) for result in results if result is not winner)
    assert hashlib.sha256(await read(store, "a")).hexdigest() == winner.digest


async def test_stray_files_are_reported_and_ignored(store: AssetStore, tmp_path: Path) -> None:
    await store.put(chunks(b"kept"), "kept")
    lost = await store.put(chunks(b"lost"), "lost")
    (tmp_path / "content" / lost.digest[:2] / lost.digest).unlink()
    (tmp_path / "records" / "damaged.json").write_bytes(b"{")
    (tmp_path / "incoming" / "half").write_bytes(b"half")
    with pytest.raises(StorageError, match=str(tmp_path)):
        await read(store, "lost")
    again = await AssetStore.open(tmp_path)
    assert [asset.id for asset in again.infos()] == ["kept"]
    assert not list((tmp_path / "incoming").iterdir())


async def test_an_unusable_directory_is_named(tmp_path: Path) -> None:
    (tmp_path / "assets").write_text("a file")
    with pytest.raises(StorageError, match=str(tmp_path / "assets")):
        await AssetStore.open(tmp_path / "assets")


async def test_driver_assets_are_read_but_not_listed_and_uploads_take_precedence(
    store: AssetStore, tmp_path: Path
) -> None:
    await store.offer("arm.zip", b"the driver's", "of a driver")
    assert store.exists("arm.zip")
    assert store.infos() == []
    assert await read(store, "arm.zip") == b"the driver's"
    assert store.file("arm.zip").read_bytes() == b"the driver's"
    with pytest.raises(Conflict, match=r"arm\.zip.*installed driver"):
        await store.delete("arm.zip")
    with pytest.raises(Conflict):
        await store.put(chunks(b"mine"), "arm.zip")
    await store.put(chunks(b"mine"), "arm.zip", upsert=True)
    assert await read(store, "arm.zip") == b"mine"
    await store.delete("arm.zip")
    assert await read(store, "arm.zip") == b"the driver's"
    # Uploading and deleting the same bytes leaves the driver's assets available.
    await store.put(chunks(b"the driver's"), "copy")
    await store.delete("copy")
    assert await read(store, "arm.zip") == b"the driver's"
    assert not (await AssetStore.open(tmp_path)).exists("arm.zip")
