"""The file of alarms: records of older servers are taken over once, and nothing stored is lost."""

import signal
import subprocess
import sys
from pathlib import Path

from msgspec.structs import replace

from arcor2_hw.data.alarms import AlarmCategory, AlarmRecord, Priority
from arcor2_server.settings import ServerSettings
from arcor2_server.storage import Storage
from arcor2_server.storage.alarms import AlarmStore, _encode
from arcor2_server.storage.models import AlarmRow
from arcor2_server.storage.outbox import OutboxKind

AT = "2026-01-01T00:00:00+00:00"


def record(number: int) -> AlarmRecord:
    return AlarmRecord(number, "test-1", "code", Priority.HIGH, AlarmCategory.DEVICE, "text", AT, number)


async def put_in_database(storage: Storage, number: int) -> None:
    async with storage.writing() as session:
        await storage.upsert(session, AlarmRow(number=number, document=_encode(record(number))))


async def numbers(path: Path, storage: Storage) -> list[int]:
    store = AlarmStore(path, storage)
    assert await store.open() is None
    found = [each.number for each in await store.all()]
    await store.close()
    return found


async def test_records_of_older_servers_are_taken_over_once(tmp_path: Path) -> None:
    storage, path = await Storage.open(ServerSettings(data_dir=tmp_path)), tmp_path / "alarms.sqlite"
    await put_in_database(storage, 1)
    await put_in_database(storage, 2)
    assert await numbers(path, storage) == [1, 2]
    await put_in_database(storage, 7)  # as if a server had ended before it deleted the records of the database
    store = AlarmStore(path, storage)
    assert await store.open() is None
    await store.put([record(3)], {1})
    await store.close()
    assert await numbers(path, storage) == [2, 3]
    path.unlink()
    assert await numbers(path, storage) == []
    await storage.close()


async def test_changed_records_wait_for_the_fleet(tmp_path: Path) -> None:
    storage, path = await Storage.open(ServerSettings(data_dir=tmp_path)), tmp_path / "alarms.sqlite"
    store = AlarmStore(path, storage, sends=True)
    assert store.outbox is not None
    await store.open()
    await store.put([record(1), record(2)], set())
    before = await store.outbox.first(10)
    assert [each.document for each in before] == [_encode(record(1)), _encode(record(2))]
    changed = replace(record(1), text="changed")
    await store.put([changed], set())  # while its first version is being sent
    await store.outbox.remove(each.number for each in before)
    await store.close()
    again = AlarmStore(path, storage, sends=True)
    assert again.outbox is not None
    await again.open()
    (waiting,) = await again.outbox.first(10)
    assert (waiting.kind, waiting.document) == (OutboxKind.ALARM, _encode(changed))
    assert waiting.number > max(each.number for each in before)
    await again.put([], {1})
    assert (await again.outbox.first(10), await again.outbox.count()) == ([], 0)
    await again.close()
    await storage.close()


async def test_a_damaged_file_is_renamed_and_old_records_do_not_return(tmp_path: Path) -> None:
    storage, path = await Storage.open(ServerSettings(data_dir=tmp_path)), tmp_path / "alarms.sqlite"
    path.write_bytes(b"damaged" * 1000)
    await put_in_database(storage, 1)
    store = AlarmStore(path, storage)
    problem = await store.open()
    assert problem is not None
    assert "alarms.damaged-" in problem.text
    assert await store.all() == []
    await store.close()
    assert await numbers(path, storage) == []
    await storage.close()


async def test_a_killed_server_loses_no_stored_record(tmp_path: Path) -> None:
    script = (
        "import asyncio, os, signal, sys\nfrom pathlib import Path\n"
        "from arcor2_server.settings import ServerSettings\nfrom arcor2_server.storage import Storage\n"
        "from tests.server.core.test_alarm_store import AlarmStore, record\n"
        "async def main():\n    path = Path(sys.argv[1])\n"
        "    store = AlarmStore(path / 'alarms.sqlite', await Storage.open(ServerSettings(data_dir=path)))\n"
        "    await store.open()\n    await store.put([record(5)], set())\n    os.kill(os.getpid(), signal.SIGKILL)\n"
        "asyncio.run(main())\n"
    )
    root = Path(__file__).parents[3]
    ended = subprocess.run([sys.executable, "-c", script, tmp_path], cwd=root, check=False)
    assert ended.returncode == -signal.SIGKILL
    storage = await Storage.open(ServerSettings(data_dir=tmp_path))
    assert await numbers(tmp_path / "alarms.sqlite", storage) == [5]
    await storage.close()
