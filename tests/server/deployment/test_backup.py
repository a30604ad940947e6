"""Backups: the state of one moment while the server writes, and restorations that lose nothing when interrupted."""

import asyncio
import contextlib
import json
import os
import shutil
import sqlite3
import threading
import zipfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from pathlib import Path
from typing import IO

import pytest
from websockets.asyncio.client import connect

from arcor2_hw.exceptions import InvalidData, StorageError
from arcor2_server.audit.chain import AuditFile
from arcor2_server.cli.backup import backup, restore
from arcor2_server.cli.exit_status import ExitStatus
from arcor2_server.cli.serve import data_directory
from arcor2_server.deployment import backup as backups
from arcor2_server.deployment.backup import MANIFEST, finish_restoration, restore_backup, write_backup
from tests.server.core.serving import running, talking

WITHIN = 30.0


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """Return a data directory with two SQLite files and some others."""
    directory = tmp_path / "data"
    (directory / "assets" / "content").mkdir(parents=True)
    (directory / "prepared").mkdir()
    for name in ("journal.sqlite", "documents.sqlite"):
        with closing(sqlite3.connect(directory / name)) as connection:
            connection.execute("pragma journal_mode=wal")
            connection.execute("create table number (value integer)")
            connection.execute("insert into number values (0)")
            connection.commit()
    (directory / "assets" / "content" / "mesh").write_bytes(bytes(range(256)) * 100)
    (directory / "secrets.json").write_text('{"password": "1234"}')
    for derived in ("analysis.msgpack", "lock", "prepared/mesh", ".secrets.json.0f"):
        (directory / derived).write_text("derived")
    return directory


def _content(directory: Path) -> dict[str, bytes]:
    """Return the files of a directory, with SQLite files as dumps, except lists of replaced files."""
    found = {}
    for path in sorted(directory.rglob("*")):
        name = str(path.relative_to(directory))
        if path.is_dir() or name.startswith("before-restore") or name == "lock":
            continue
        if path.suffix == ".sqlite":
            with closing(sqlite3.connect(path)) as connection:
                found[name] = "\n".join(connection.iterdump()).encode()
        elif not name.endswith(("-wal", "-shm")):
            found[name] = path.read_bytes()
    return found


def _number(path: Path) -> int:
    with closing(sqlite3.connect(path)) as connection:
        value: int = connection.execute("select value from number").fetchone()[0]
    return value


def test_a_restored_directory_has_the_same_content(data: Path, tmp_path: Path) -> None:
    before = _content(data)
    manifest = write_backup(data, tmp_path / "backup.zip", "0.1.0")
    assert (tmp_path / "backup.zip").stat().st_mode & 0o777 == 0o600
    restored = tmp_path / "restored"
    restored.mkdir()
    assert restore_backup(tmp_path / "backup.zip", restored) == manifest
    for derived in ("analysis.msgpack", "prepared/mesh", ".secrets.json.0f"):
        del before[derived]
    assert _content(restored) == before
    assert all(path.stat().st_mode & 0o077 == 0 for path in restored.rglob("*"))


async def test_a_server_continues_on_another_machine(tmp_path: Path) -> None:
    box = {"type": "Box", "box": {"id": "Table", "size_x": 1, "size_y": 1, "size_z": 1}}
    async with running(tmp_path / "data") as server, talking(_socket(server.url), "ann") as ann:
        await ann.granted("NewScene", {"name": "Cell"})
        pose = {"position": {"x": 0, "y": 0, "z": 0}, "orientation": {"x": 0, "y": 0, "z": 0, "w": 1}}
        await ann.granted("AddVirtualCollisionObjectToScene", {"name": "Table", "pose": pose, "model": box})
        write_backup(server.data_dir, tmp_path / "backup.zip", "0.1.0")
    spare = tmp_path / "spare"
    spare.mkdir()
    restore_backup(tmp_path / "backup.zip", spare)
    async with running(spare) as server, connect(_socket(server.url)) as socket:
        async with asyncio.timeout(WITHIN):
            while (event := json.loads(await socket.recv()))["event"] != "OpenScene":
                pass
        assert [one["name"] for one in event["data"]["scene"]["objects"]] == ["Table"], "the edit was not saved"
    assert "damaged" not in (tmp_path / "spare.log").read_text()
    assert AuditFile(spare / "audit.sqlite").check().problem == ""


def _socket(url: str) -> str:
    return url.replace("http", "ws", 1)


def test_a_backup_contains_the_state_of_one_moment(data: Path, tmp_path: Path) -> None:
    ended, started = threading.Event(), threading.Event()

    def write() -> None:
        # The server saves a document before it records that in the journal.
        names = ("documents.sqlite", "journal.sqlite")
        with ExitStack() as stack:
            connections = [stack.enter_context(closing(sqlite3.connect(data / name, timeout=WITHIN))) for name in names]
            while not ended.is_set():
                for connection in connections:
                    connection.execute("update number set value = value + 1")
                    connection.commit()
                started.set()

    writer = threading.Thread(target=write)
    writer.start()
    try:
        assert started.wait(WITHIN)
        for number in range(10):
            restored = tmp_path / f"restored{number}"
            restored.mkdir()
            write_backup(data, tmp_path / f"{number}.zip", "0.1.0")
            restore_backup(tmp_path / f"{number}.zip", restored)
            journal, documents = (_number(restored / name) for name in ("journal.sqlite", "documents.sqlite"))
            assert journal <= documents, "the journal records a save that the documents do not contain"
    finally:
        ended.set()
        writer.join()
    assert _number(data / "documents.sqlite") > 10, "the writer did not write during the backups"


def test_a_file_deleted_during_the_backup_is_left_out(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    original = backups._add

    def add(archive: zipfile.ZipFile, file: IO[bytes], name: str, path: Path) -> backups.BackupEntry:
        (data / "secrets.json").unlink(missing_ok=True)
        return original(archive, file, name, path)

    monkeypatch.setattr(backups, "_add", add)
    assert "secrets.json" not in write_backup(data, tmp_path / "backup.zip", "0.1.0").files


def test_a_file_listed_during_the_backup_is_included(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    original = backups._snapshot

    @contextlib.contextmanager
    def snapshot(path: Path, scratch: Path) -> Iterator[sqlite3.Connection]:
        (data / "listed.parquet").write_bytes(b"rows")
        with original(path, scratch) as connection:
            yield connection

    monkeypatch.setattr(backups, "_snapshot", snapshot)
    assert "listed.parquet" in write_backup(data, tmp_path / "backup.zip", "0.1.0").files


def test_a_failed_backup_leaves_no_file(data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def add(archive: zipfile.ZipFile, file: IO[bytes], name: str, path: Path) -> backups.BackupEntry:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(backups, "_add", add)
    target = tmp_path / "backups"
    target.mkdir()
    with pytest.raises(StorageError, match="No space left on device"):
        write_backup(data, target / "backup.zip", "0.1.0")
    assert list(target.iterdir()) == []


@pytest.mark.parametrize("steps", range(12))
def test_an_interrupted_restoration_is_completed(
    steps: int, data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_backup(data, tmp_path / "backup.zip", "0.1.0")
    expected = _content(data)
    (data / "secrets.json").write_text("newer")
    (data / "cell-state.json").write_text("newer")
    before = _content(data)
    left = steps
    original = Path.rename

    def rename(path: Path, target: Path) -> Path:
        nonlocal left
        if left == 0:
            raise OSError(5, "the power fails")
        left -= 1
        return original(path, target)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "rename", rename)
        with pytest.raises(StorageError, match="the power fails"):
            restore_backup(tmp_path / "backup.zip", data)
    (data / "device-files").mkdir(exist_ok=True)  # as the next start does
    finish_restoration(data)
    restored = _content(data)
    if steps == 0:  # the backup was not yet unpacked
        assert restored == before
        return
    assert restored == {name: content for name, content in expected.items() if name in restored}
    assert {"journal.sqlite", "documents.sqlite", "secrets.json", "assets/content/mesh"} == set(restored)
    (replaced,) = data.glob("before-restore-*")
    assert (replaced / "secrets.json").read_text() == "newer"
    assert (replaced / "cell-state.json").read_text() == "newer"


def _rewritten(source: Path, change: Callable[[dict[str, bytes]], None]) -> Path:
    with zipfile.ZipFile(source) as archive:
        content = {name: archive.read(name) for name in archive.namelist()}
    change(content)
    target = source.with_name("changed.zip")
    with zipfile.ZipFile(target, "w") as archive:
        for name, data in content.items():
            archive.writestr(name, data)
    return target


def _edit(content: dict[str, bytes], **changes: object) -> None:
    content[MANIFEST] = json.dumps(json.loads(content[MANIFEST]) | changes).encode()


def _listed(content: dict[str, bytes], name: str) -> None:
    manifest = json.loads(content[MANIFEST])
    manifest["files"][name] = manifest["files"].pop("secrets.json")
    content[name] = content.pop("secrets.json")
    content[MANIFEST] = json.dumps(manifest).encode()


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda content: content.pop(MANIFEST), "not a backup"),
        (lambda content: content.update({"secrets.json": b"x"}), "secrets.json of the backup is damaged"),
        (lambda content: content.update({"secrets.json": bytes(100_000_000)}), "secrets.json of the backup is damaged"),
        (lambda content: content.update({"more": b"x"}), "other files than it lists"),
        (lambda content: content.pop("secrets.json"), "other files than it lists"),
        (lambda content: content.update({MANIFEST: b"{"}), "invalid list of files"),
        (lambda content: content.update({MANIFEST: b"{}"}), "format 0"),
        (lambda content: _edit(content, format=2), "format 2"),
        (lambda content: _listed(content, "../secrets.json"), "invalid path"),
        (lambda content: _listed(content, "/etc/secrets.json"), "invalid path"),
        (lambda content: _listed(content, "a\\secrets.json"), "invalid path"),
        (lambda content: _listed(content, "a//secrets.json"), "invalid path"),
        (lambda content: _listed(content, ".restore-ready/secrets.json"), "invalid path"),
        (lambda content: _listed(content, "lock"), "invalid path"),
    ],
)
def test_a_changed_backup_is_refused(
    change: Callable[[dict[str, bytes]], None], reason: str, data: Path, tmp_path: Path
) -> None:
    write_backup(data, tmp_path / "backup.zip", "0.1.0")
    before = _content(data)
    with pytest.raises(InvalidData, match=reason):
        restore_backup(_rewritten(tmp_path / "backup.zip", change), data)
    assert _content(data) == before
    assert not list(data.glob("before-restore-*"))


@pytest.mark.parametrize("part", [0.1, 0.5, 0.99])
def test_an_incomplete_backup_is_refused(part: float, data: Path, tmp_path: Path) -> None:
    write_backup(data, tmp_path / "backup.zip", "0.1.0")
    content = (tmp_path / "backup.zip").read_bytes()
    (tmp_path / "backup.zip").write_bytes(content[: int(len(content) * part)])
    with pytest.raises(InvalidData, match="damaged"):
        restore_backup(tmp_path / "backup.zip", data)


def test_every_flipped_byte_is_noticed_or_harmless(data: Path, tmp_path: Path) -> None:
    write_backup(data, tmp_path / "backup.zip", "0.1.0")
    content = (tmp_path / "backup.zip").read_bytes()
    expected = _content(data)
    for position in range(0, len(content), len(content) // 60):
        changed = bytearray(content)
        changed[position] ^= 0x55
        (tmp_path / "flipped.zip").write_bytes(changed)
        target = tmp_path / "target"
        target.mkdir()
        try:
            restore_backup(tmp_path / "flipped.zip", target)
        except InvalidData:
            assert list(target.iterdir()) == []
        else:  # the byte belongs to a field that is not read, such as a time
            assert {name: expected[name] for name in _content(target)} == _content(target)
        shutil.rmtree(target)


# ------------------------------------------------------------------------------------------------ commands
def test_an_existing_backup_is_not_overwritten(data: Path, tmp_path: Path) -> None:
    target = tmp_path / "backup.zip"
    target.write_text("mine")
    assert backup(target, data_dir=data) == ExitStatus.CONFLICT
    assert target.read_text() == "mine"
    assert backup(target, data_dir=data, force=True) == ExitStatus.OK
    assert zipfile.is_zipfile(target)


def test_data_in_use_is_not_replaced(data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert backup(tmp_path / "backup.zip", data_dir=data) == ExitStatus.OK
    with data_directory(data):
        assert restore(tmp_path / "backup.zip", data_dir=data) == ExitStatus.DATA_IN_USE
    assert "in use" in capsys.readouterr().err
    assert restore(tmp_path / "backup.zip", data_dir=data) == ExitStatus.OK
    assert "4 files" in capsys.readouterr().out


def test_missing_and_unreadable_files_are_reported(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert backup(tmp_path / "backup.zip", data_dir=tmp_path / "missing") == ExitStatus.DATA_UNUSABLE
    assert restore(tmp_path / "missing.zip", data_dir=data) == ExitStatus.NOT_FOUND
    (tmp_path / "text.zip").write_text("text")
    assert restore(tmp_path / "text.zip", data_dir=data) == ExitStatus.DOCUMENT_PROBLEMS
    assert "missing" in capsys.readouterr().err


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a directory to another user")
def test_root_does_not_write_the_data_of_the_service(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    os.chown(data, 65534, -1)
    assert backup(tmp_path / "backup.zip", data_dir=data) == ExitStatus.DATA_UNUSABLE
    assert restore(tmp_path, data_dir=data) == ExitStatus.NOT_FOUND
    assert "runuser -u" in capsys.readouterr().err
