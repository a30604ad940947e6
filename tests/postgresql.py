"""A temporary PostgreSQL server for the tests, in which each data directory has a database of its own.

The fixture `postgresql` stores documents in it instead of SQLite. All tests do so if ARCOR2_HW_DATABASE_URL is set: to
`postgresql+psycopg://`, or to the URL of a server whose user may create databases.
"""

import asyncio
import contextlib
import fcntl
import functools
import os
import shutil
import subprocess
import tempfile
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import psycopg
import pytest
from msgspec.structs import replace
from sqlalchemy import URL, create_engine, make_url

from arcor2_server.settings import ServerSettings
from arcor2_server.storage import database, schema, store
from arcor2_server.storage.models import Base

VARIABLE = "ARCOR2_HW_DATABASE_URL"
CHOSEN = "ARCOR2_HW_TEST_DATABASE"
"""The variable to which VARIABLE is moved, so that no server started by a test uses it by itself."""
TEMPLATE = "arcor2_hw_test_template"
SERVER_USER = "nobody"
"""The user of the server if the tests run as root, which PostgreSQL refuses."""
WATCH = """
while [ -d /proc/$1 ]; do sleep 1; done
"$2" -D "$3/data" -m immediate stop
rm -rf "$3"
"""
"""Shell script that stops the server when the test run has ended for any reason."""


def pytest_configure() -> None:
    if VARIABLE in os.environ:
        os.environ[CHOSEN] = os.environ.pop(VARIABLE)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if CHOSEN not in os.environ:
        return
    left_out = [item for item in items if item.get_closest_marker("sqlite")]
    config.hook.pytest_deselected(items=left_out)
    items[:] = [item for item in items if item not in left_out]
    for item in items:
        item.fixturenames.insert(0, "postgresql")  # type: ignore[attr-defined]


@functools.cache
def server() -> URL:
    """Return the URL of the server. Start it, and create the template of the databases, if no other worker has."""
    chosen = make_url(os.environ.get(CHOSEN) or "postgresql+psycopg://")
    if chosen.host or chosen.query:
        _create_template(chosen)
        return chosen
    worker = "PYTEST_XDIST_WORKER" in os.environ
    run = os.getppid() if worker else os.getpid()
    folder = Path(tempfile.gettempdir()) / f"arcor2-hw-postgresql-{run}"
    folder.mkdir(mode=0o700, exist_ok=True)
    url = URL.create("postgresql+psycopg", "hub", query={"host": str(folder)})
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (folder / "data").exists():
            start(folder, run)
            _create_template(url)
    return url


def programs() -> Path:
    """Return the folder of the newest PostgreSQL on this machine."""
    return max(Path("/usr/lib/postgresql").glob("*/bin"), key=lambda each: int(each.parent.name))


FAST = "-c fsync=off -c full_page_writes=off"
"""Options of a server whose data are not needed after a power cut."""
DURABLE = ""
"""Options of a server that flushes to the disk."""


def start(folder: Path, run: int, options: str = FAST) -> None:
    """Start a server in an empty folder. It is stopped when the process `run` has ended."""
    as_user = _server_user()
    if as_user:
        shutil.chown(folder, SERVER_USER)
    folder_of_programs = programs()
    options = f"-k {folder} -c listen_addresses= -c shared_buffers=32MB {options}"
    for command in (
        ["initdb", "-D", folder / "data", "-U", "hub", "-A", "trust", "-E", "UTF8", "--locale=C.UTF-8", "--no-sync"],
        ["pg_ctl", "-D", folder / "data", "-w", "-l", folder / "log", "-o", options, "start"],
    ):
        program = [folder_of_programs / str(command[0]), *command[1:]]
        subprocess.run(program, check=True, stdout=subprocess.DEVNULL, cwd=folder, **as_user)
    watch = ["setsid", "--fork", "sh", "-c", WATCH, "watch", str(run), folder_of_programs / "pg_ctl", folder]
    null = subprocess.DEVNULL
    subprocess.run(watch, check=True, stdin=null, stdout=null, stderr=null, cwd="/", **as_user)


def stop(folder: Path) -> None:
    """Stop the server in a folder."""
    command = [programs() / "pg_ctl", "-D", folder / "data", "-m", "fast", "stop"]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, cwd="/", **_server_user())


def _server_user() -> dict[str, Any]:
    """Return the options with which a process runs as the user of the server."""
    return {"user": SERVER_USER, "group": "nogroup", "extra_groups": []} if os.getuid() == 0 else {}


def execute(statement: str, url: URL | None = None) -> None:
    """Execute a statement in the maintenance database, or in another one."""
    url = url or server().set(database="postgres")
    with psycopg.connect(url.set(drivername="postgresql").render_as_string(False), autocommit=True) as connection:
        connection.execute(statement)  # type: ignore[call-overload]


def _create_template(url: URL) -> None:
    """Create a database with all tables. Copying it takes a tenth of the time of creating them."""
    maintenance = url.set(database="postgres")
    execute(f"DROP DATABASE IF EXISTS {TEMPLATE}", maintenance)
    execute(f"CREATE DATABASE {TEMPLATE} TEMPLATE template0 ENCODING 'UTF8' LOCALE 'C.UTF-8'", maintenance)
    engine = create_engine(url.set(database=TEMPLATE))
    with engine.begin() as connection:
        schema.migrate(connection)
    engine.dispose()


_spare: list[str] = []
"""Databases of earlier tests without rows. Creating one takes 0.2 s of processor time."""


class Databases:
    """The databases of a test, by data directory."""

    def __init__(self) -> None:
        self._names: dict[Path, str] = {}

    def url(self, directory: Path) -> str:
        """Return the URL of the database of a data directory. Create it at the first call."""
        if directory not in self._names:
            if _spare:
                name = _spare.pop()
            else:
                name = f"arcor2_hw_test_{uuid.uuid4().hex[:12]}"
                execute(f"CREATE DATABASE {name} TEMPLATE {TEMPLATE}")
            self._names[directory] = name
        return server().set(database=self._names[directory]).render_as_string(False)

    def interrupt(self, directory: Path) -> None:
        """End all connections to the database of a data directory, as a restart of the server does."""
        _disconnect(self._names[directory])

    def close(self) -> None:
        """Delete all rows, and keep the databases for other tests; drop those whose schema has changed."""
        rows = "; ".join(f'DELETE FROM "{table.name}"' for table in reversed(Base.metadata.sorted_tables))
        for name in self._names.values():
            _disconnect(name)
            try:
                execute(f"UPDATE alembic_version SET version_num = '{schema.REVISION}'", server().set(database=name))
                execute(rows, server().set(database=name))
            except psycopg.Error:
                execute(f"DROP DATABASE {name} WITH (FORCE)")
            else:
                _spare.append(name)


def _disconnect(name: str) -> None:
    execute(f"SELECT pg_terminate_backend(pid, 10000) FROM pg_stat_activity WHERE datname = '{name}'")


_current: list[Databases] = []
"""The databases of the present test, if it uses PostgreSQL."""


_lasting: dict[Path, Databases] = {}
"""The databases of data directories whose servers outlive the present test."""


@contextlib.contextmanager
def lasting(directory: Path) -> Iterator[None]:
    """Keep the database of a data directory until the end of the block, if the present test uses PostgreSQL.

    Fixtures whose server outlives a test need it: the databases of a test are emptied and used again after the test.
    """
    if not _current:
        yield
        return
    databases = _lasting[directory] = Databases()
    try:
        yield
    finally:
        del _lasting[directory]
        databases.close()


def variables(directory: Path) -> dict[str, str]:
    """Return the environment variables of a server with a data directory: those for PostgreSQL if the test uses it."""
    if not _current:
        return {}
    return {VARIABLE: _lasting.get(directory, _current[0]).url(directory)}


@pytest.fixture(scope="session")
def postgresql_server() -> Iterator[URL]:
    """Start the server in a fixture whose resources may outlive a test."""
    yield server()
    for name in _spare:
        execute(f"DROP DATABASE {name} WITH (FORCE)")


@pytest.fixture
def databases(postgresql_server: URL) -> Iterator[Databases]:
    """Provide databases in PostgreSQL."""
    created = Databases()
    yield created
    created.close()


@pytest.fixture
def postgresql(databases: Databases, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Store the documents of all data directories in PostgreSQL."""
    opened = database.open_engines

    async def open_engines(settings: ServerSettings, **options: bool) -> database.Engines:
        if not settings.database_url:
            settings = replace(settings, database_url=databases.url(settings.data_dir))
        return await opened(settings, **options)

    monkeypatch.setattr(store, "open_engines", open_engines)
    _current.append(databases)
    yield
    _current.clear()


class Relay:
    """A TCP port of 127.0.0.1 in front of the server, which can refuse connections as a stopped server does."""

    def __init__(self, url: str) -> None:
        self._url = make_url(url)
        self._listener: asyncio.Server | None = None
        self._relays: set[asyncio.Task[None]] = set()
        self.port = 0

    @property
    def url(self) -> str:
        return self._url.set(host="127.0.0.1", port=self.port, query={}).render_as_string(False)

    async def open(self) -> None:
        self._listener = await asyncio.start_server(self._serve, "127.0.0.1", self.port)
        self.port = self._listener.sockets[0].getsockname()[1]

    async def close(self) -> None:
        assert self._listener is not None
        self._listener.close()
        for relay in self._relays:
            relay.cancel()
        await asyncio.gather(*self._relays, return_exceptions=True)
        await self._listener.wait_closed()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        self._relays.add(task)
        host = str(self._url.query.get("host") or self._url.host)
        if host.startswith("/"):
            far_reader, far_writer = await asyncio.open_unix_connection(f"{host}/.s.PGSQL.{self._url.port or 5432}")
        else:
            far_reader, far_writer = await asyncio.open_connection(host, self._url.port or 5432)
        try:
            async with asyncio.TaskGroup() as both:
                both.create_task(_pass_on(reader, far_writer))
                both.create_task(_pass_on(far_reader, writer))
        finally:
            self._relays.discard(task)
            for end in (writer, far_writer):
                end.transport.abort()


async def _pass_on(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    with contextlib.suppress(ConnectionError):
        while data := await reader.read(65536):
            writer.write(data)
            await writer.drain()
    if writer.can_write_eof() and not writer.is_closing():
        writer.write_eof()
