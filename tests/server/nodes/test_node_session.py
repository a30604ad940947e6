"""Parts of a session without a broker: clocks, lanes, and commands that must not be executed any more."""

import asyncio
import hashlib
import os
import random
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import msgspec
import pytest
from msgspec.structs import replace

from arcor2_hw.data.device import Connection, Health
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.object_type import Mesh, Model3dType, ObjectModel
from arcor2_hw.data.operation import HoldKind
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import InvalidData, NotFound
from arcor2_hw.messages import Message
from arcor2_hw.runtime import messages as m
from arcor2_server.nodes.confirmation import confirm_sent
from arcor2_server.nodes.connections import connect_client
from arcor2_server.nodes.content import Content, ContentStore
from arcor2_server.nodes.conversion import for_host, for_server
from arcor2_server.nodes.credentials import Credentials
from arcor2_server.nodes.lanes import END, PART_SIZE, Header, Lane, LaneReader, LaneWriter, MessageLost
from arcor2_server.nodes.opening import Opening, refusal_of
from arcor2_server.nodes.presence import own_version
from arcor2_server.nodes.service import HostedSession
from arcor2_server.nodes.session_clock import SessionClock


@pytest.mark.parametrize("offset", [0.0, 3600.0, -86400.0])
@pytest.mark.parametrize("rate", [1.0, 1.0 + 4e-4, 1.0 - 4e-4])
def test_a_converted_time_is_never_late_and_less_than_12_ms_early(offset: float, rate: float) -> None:
    """The peer's clock differs by `offset` s and runs at another `rate`. Messages take 0.2 ms to 100 ms."""
    chance, clock, now = random.Random(1), SessionClock(), 1000.0
    early = []
    for _ in range(2000):
        sent = now
        arrived = sent + chance.choice([0.0002, 0.001, 0.1])
        now = arrived + chance.choice([0.0002, 0.001, 0.1])
        clock.exchanged(sent, arrived * rate + offset, now)
        moment = now - chance.uniform(0.0, 0.5)
        early.append(moment - clock.earliest(moment * rate + offset, now))
        now += 0.1
    assert min(early) >= -1e-9
    assert max(early[200:]) < 0.012


def test_times_cannot_be_converted_before_the_first_exchange() -> None:
    with pytest.raises(LookupError):
        SessionClock().earliest(1.0, 1.0)


@pytest.mark.parametrize("size", [0, 1, PART_SIZE, PART_SIZE + 1, 5 * PART_SIZE])
def test_long_messages_are_divided_and_joined(size: int) -> None:
    writer, reader = LaneWriter(), LaneReader()
    body = random.Random(2).randbytes(size)
    for number in (1, 2):
        *before, last = [reader.message(part) for part in writer.parts(number, 1.5, END, body)]
        assert before == [None] * (max(size - 1, 0) // PART_SIZE)
        assert last is not None
        header, found = last
        assert (header.number, header.sent, header.flags, found) == (number, 1.5, END, body)


def test_a_lost_part_raises_an_error() -> None:
    writer, reader = LaneWriter(), LaneReader()
    first, second = [next(writer.parts(number, 0.0, 0, b"x")) for number in (1, 2)]
    with pytest.raises(MessageLost):
        reader.message(second)
    with pytest.raises(MessageLost):
        LaneReader().message(first[:3])


def encoded(message: m.ToHost | m.ToServer) -> bytes:
    return msgspec.msgpack.encode(message)


@pytest.mark.parametrize(
    ("message", "converted"),
    [
        (m.Lease(1, "arm", 1, HoldKind.JOG, 5.0), m.Lease(1, "arm", 1, HoldKind.JOG, 105.0)),
        (m.Lease(1, "arm", 1, HoldKind.JOG, 0.0), m.Lease(1, "arm", 1, HoldKind.JOG, 0.0)),  # the end of a hold
        (m.ForcePoint(1, "io", "lamp", 1, True, 5.0), m.ForcePoint(1, "io", "lamp", 1, True, 105.0)),
        (m.RenewForces([1], 5.0), m.RenewForces([1], 105.0)),
        (m.Call(1, "arm", "move"), m.Call(1, "arm", "move")),
    ],
    ids=["lease", "release", "force", "renewal", "call"],
)
def test_times_of_commands_are_converted(message: m.ToHost, converted: m.ToHost) -> None:
    assert for_host(type(message).__name__, encoded(message), lambda moment: moment + 100.0) == encoded(converted)


def report(offset: float) -> list[m.ToServer]:
    error = m.ErrorData("error", "Arcor2Error", Message.of("It failed."), stamp=1.0 + offset)
    normal = (Connection.ONLINE, Health.NORMAL)
    return [
        m.DeviceChanged("arm", *normal, stamp=2.0 + offset, raised={"code": 3.0 + offset}),
        m.CallFailed(1, error),
        m.SceneFailed(error),
        m.SceneClosed(error),
        m.SceneClosed(),
        m.HoldEnded("arm", 1, error),
        m.ForceEnded(1, error),
        m.HandTeachingEnded("arm", error),
        m.ProgramChanged("stopped", False, error),
        m.Heartbeat(),
    ]


@pytest.mark.parametrize(("message", "converted"), list(zip(report(0.0), report(100.0), strict=True)))
def test_times_of_reports_are_converted(message: m.ToServer, converted: m.ToServer) -> None:
    assert for_server(type(message).__name__, encoded(message), lambda moment: moment + 100.0) == encoded(converted)


def test_another_version_is_refused_in_one_sentence() -> None:
    assert refusal_of("press", Opening("1", own_version())) is None
    assert str(refusal_of("press", Opening("1", "0.0.9"))) == (
        f"The node press runs version {own_version()} and the server version 0.0.9: install the same one."
    )


class NodeSession:
    """A session on a node whose clock agrees with the server's, without a broker."""

    def __init__(self) -> None:
        async def flush() -> None:
            """Everything is sent."""

        client: Any = SimpleNamespace(flush=flush)
        folder: Any = None  # the messages of these tests name no files
        self.session = HostedSession(
            {Lane.CALLS: client}, "press", Opening("1", own_version()), ContentStore(Path("/nowhere")), folder
        )
        self.host: list[Any] = []
        self.server: list[Any] = []
        stream: Any = SimpleNamespace(
            send=lambda body: self.host.append(m.decode_host_bound(body)), close=lambda: self.host.append("closed")
        )
        self.session._stream = stream
        self.session.end.send = self._send  # type: ignore[method-assign]
        moment = time.monotonic()
        self.session.end.clock.exchanged(moment, moment, moment)

    def _send(self, lane: Lane, body: bytes, flags: int = 0, **_: Any) -> None:
        self.server.append(
            (lane, str(msgspec.msgpack.decode(body, type=Message)) if flags else m.decode_server_bound(body))
        )

    def receive(self, message: m.ToHost, number: int, *, lane: Lane = Lane.CALLS, age: float = 0.0) -> None:
        self.session.received(lane, Header(number, 0, time.monotonic() - age, 0), encoded(message))


@pytest.fixture
def node_session() -> NodeSession:
    return NodeSession()


def test_a_command_that_a_stop_has_overtaken_is_not_executed(node_session: NodeSession) -> None:
    stop = m.StopMotion(7, "arm")
    node_session.receive(stop, 5, lane=Lane.STOP)
    node_session.receive(m.Call(1, "arm", "move"), 4)
    node_session.receive(other := m.Call(2, "belt", "move"), 3)
    node_session.receive(after := m.Call(3, "arm", "move"), 6)
    assert node_session.host == [stop, other, after]
    ((lane, refused),) = node_session.server
    assert (lane, refused.id, refused.error.code) == (Lane.CALLS, 1, "cancelled")
    node_session.receive(all_stop := m.StopAll(8), 9, lane=Lane.STOP)
    node_session.receive(m.Call(4, "belt", "move"), 8)
    node_session.receive(m.Resume(), 7)
    node_session.receive(subscribe := m.Subscribe("arm", True, False), 8)  # starts nothing
    assert node_session.host[3:] == [all_stop, subscribe]


async def test_a_late_command_is_not_executed(node_session: NodeSession) -> None:
    node_session.receive(m.Call(1, "arm", "move"), 1, age=1.0)
    node_session.receive(m.Call(2, "arm", "state", deadline=0.1), 2, age=0.2)
    node_session.receive(m.Resume(), 3, age=1.0)
    node_session.receive(m.Lease(3, "arm", 1, HoldKind.JOG, time.monotonic() + 5.0), 3, age=1.0)
    node_session.receive(stop := m.StopMotion(4, "arm"), 4, lane=Lane.STOP, age=1.0)
    assert node_session.host == [stop], "only the late stop is executed"
    assert [getattr(message, "id", None) for _, message in node_session.server] == [1, 2, None, 3]
    assert {message.error.code for _, message in node_session.server if isinstance(message, m.CallFailed)} == {
        "arrived_late"
    }
    node_session.receive(release := m.Lease(5, "arm", 1, HoldKind.JOG, 0.0), 5, age=1.0)
    node_session.receive(m.RunPackage("pkg_1", "sha256:0:x"), 6, age=1.0)
    assert node_session.host == [stop, release, "closed"], "a session that has not started its work ends"
    assert node_session.session._failing is not None
    await node_session.session._failing
    assert "was not executed" in node_session.server[-1][1]


def test_answers_of_stops_and_large_results_have_separate_lanes(node_session: NodeSession) -> None:
    node_session.receive(m.StopMotion(4, "arm"), 1, lane=Lane.STOP)
    large = b"x" * 100_000
    for message in (
        m.CallDone(4), m.CallDone(5), m.CallDone(6, large), m.StreamEvent("e", "arm", large),
        m.ProgramEvent("PackageInfo", large),
    ):  # fmt: skip
        node_session.session._from_host(encoded(message))
    assert [lane for lane, _ in node_session.server] == [Lane.STOP, Lane.CALLS, Lane.FRAMES, Lane.FRAMES, Lane.CALLS]


# ---------------------------------------------------------------------------------------------------- files
MESH = ObjectModel(Model3dType.MESH, mesh=Mesh("box", "box.stl"))


def delivered(message: m.ToHost, store: ContentStore, folder: Path) -> tuple[Any, list[str]]:
    """Return a message at a node, and the hashes of the files that were sent for it."""
    content = Content()
    packed = content.packed(encoded(message))
    missing = store.missing(content.hashes)
    for digest in missing:
        store.add(bytes.fromhex(digest) + content.read(digest))
    return m.decode_host_bound(store.unpacked(packed, folder)), missing


def test_meshes_are_sent_once_and_keep_their_names(tmp_path: Path) -> None:
    mesh, store, folder = tmp_path / "box.stl", ContentStore(tmp_path / "store"), tmp_path / "session"
    mesh.write_bytes(b"a box")
    body = m.AddedBody("body", MESH, Pose(), file=str(mesh))
    scene = m.OpenScene(Scene("s", id="s"), [], assets={"box.stl": str(mesh)}, bodies=[body])
    found, sent = delivered(scene, store, folder)
    assert len(sent) == 1
    for file in (found.assets["box.stl"], found.bodies[0].file):
        assert (Path(file).name, Path(file).read_bytes()) == ("box.stl", b"a box")
        assert Path(file).is_relative_to(folder)
    found, sent = delivered(m.AddObject(1, scene), store, tmp_path / "other")
    assert (sent, Path(found.opening.assets["box.stl"]).read_bytes()) == ([], b"a box")
    added = m.AddBody(replace(body, file=""))
    assert delivered(added, store, folder) == (added, [])


def test_a_package_is_sent_without_data_stored_only_at_the_server(tmp_path: Path) -> None:
    package, folder = tmp_path / "package", tmp_path / "session"
    (package / "data").mkdir(parents=True)
    folder.mkdir()
    (package / "script.py").write_text("pass")
    (package / "data" / "scene.json").write_text("{}")
    store = ContentStore(tmp_path / "store")
    run = m.RunPackage("pkg_1", str(package), records="/records", recordings="/recordings")
    found, sent = delivered(run, store, folder)
    received = Path(found.directory)
    assert sorted(each.relative_to(received).as_posix() for each in received.rglob("*.*")) == [
        "data/scene.json",
        "script.py",
    ]
    assert (received / "script.py").read_text() == "pass"
    assert (len(sent), found.records, found.recordings) == (3, "", "")
    (received / "script.py").write_text("changed")
    again, sent = delivered(run, store, folder)
    assert (sent, (Path(again.directory) / "script.py").read_text()) == ([], "pass")
    assert found.records_at_server
    with pytest.raises(NotFound, match=r"missing\.stl cannot be read"):
        delivered(replace(run, assets={"a": "/missing.stl"}), store, folder)


@pytest.mark.parametrize("name", ["../../etc/passwd", "/etc/passwd"])
def test_a_package_cannot_write_outside_its_directory(tmp_path: Path, name: str) -> None:
    store = ContentStore(tmp_path / "store")
    files = [b"evil", msgspec.json.encode({name: hashlib.sha256(b"evil").hexdigest()})]
    for content in files:
        store.add(hashlib.sha256(content).digest() + content)
    run = m.RunPackage("p", f"sha256:{hashlib.sha256(files[1]).hexdigest()}:p")
    with pytest.raises(InvalidData, match="is not a path in a package"):
        store.unpacked(encoded(run), tmp_path)


@pytest.mark.parametrize("reference", ["/etc/passwd", "sha256:12:x", f"sha256:{64 * 'a'}:../x", f"sha256:{64 * 'a'}"])
def test_an_invalid_reference_is_refused(tmp_path: Path, reference: str) -> None:
    body = m.AddBody(m.AddedBody("body", MESH, Pose(), file=reference))
    with pytest.raises(InvalidData):
        ContentStore(tmp_path).unpacked(encoded(body), tmp_path)


def test_the_least_recently_used_files_are_removed(tmp_path: Path) -> None:
    contents = [bytes([number]) * 1000 for number in range(5)]
    digests = [hashlib.sha256(content).hexdigest() for content in contents]
    store = ContentStore(tmp_path, limit=2500)
    for age, digest, content in zip((7200, 3600, 5400, 0, 0), digests, contents, strict=True):
        store.add(bytes.fromhex(digest) + content)
        if age:
            os.utime(tmp_path / digest, (time.time() - age, time.time() - age))
    assert store.missing([digests[0]]) == []  # a session is about to use the oldest one
    store.prune()
    assert sorted(each.name for each in tmp_path.iterdir()) == sorted([digests[0], *digests[3:]])
    assert store.missing(digests) == digests[1:3]


def test_a_damaged_file_is_not_stored(tmp_path: Path) -> None:
    with pytest.raises(InvalidData, match="damaged"):
        ContentStore(tmp_path).add(hashlib.sha256(b"one").digest() + b"other")
    assert not list(tmp_path.iterdir())


async def test_the_broker_confirms_a_subscription_that_was_still_to_be_sent() -> None:
    """A plain `flush` of nats-py sends its ping before the subscription."""
    commands: list[bytes] = []

    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(b'INFO {"max_payload": 1048576}\r\n')
        while command := await reader.readline():
            commands.append(command.split()[0])
            if commands[-1] == b"PING":
                writer.write(b"PONG\r\n")
        writer.close()

    async with await asyncio.start_server(answer, "127.0.0.1") as broker:
        port = broker.sockets[0].getsockname()[1]
        client = await connect_client(Credentials(f"nats://127.0.0.1:{port}"), "test")
        await client.subscribe("arcor2.press.open")
        await confirm_sent(client)
        assert commands[-2:] == [b"SUB", b"PING"]
        await client.close()
