"""Credentials of cells and sites: pairing by the command line, rights, revocation, and a site, with real brokers."""

import asyncio
import contextlib
import subprocess
from collections.abc import AsyncIterator, Callable, Iterator
from pathlib import Path

import pytest
from msgspec.structs import replace
from nats.aio.msg import Msg

from arcor2_hw.exceptions import Conflict
from arcor2_server.access.authority import Authority
from arcor2_server.cli import fleet_members as cli
from arcor2_server.cli.exit_status import ExitStatus
from arcor2_server.fleet.accounts import fleet_accounts, paired_page, save_hub, set_up
from arcor2_server.fleet.records import answer_subject, state_subject, stream_name
from arcor2_server.nodes.confirmation import confirm_sent
from arcor2_server.nodes.credentials import Credentials, MemberKind, load
from arcor2_server.nodes.nkeys import Kind, SigningKey
from arcor2_server.settings import ServerSettings
from arcor2_server.storage import Storage
from tests.ports import free_port
from tests.server.fleet.broker import listens
from tests.server.fleet.cells import unit
from tests.server.fleet.test_results import CELL, FleetProcess, SmallCell, until
from tests.server.nodes.conftest import NATS_SERVER, Connected, paired_by_commands
from tests.waiting import WITHIN, wait_for

pytestmark = pytest.mark.xdist_group("fleet")


class Hub:
    """A broker configured by `set_up`, and its data directory. A broker that accepts sites uses TLS."""

    def __init__(self, folder: Path, domain: str, *, sites: bool = False) -> None:
        folder.mkdir(exist_ok=True)
        self.settings = ServerSettings(data_dir=folder / "data")
        self.accounts = fleet_accounts(self.settings)
        self.port, self.folder, self.domain = free_port(), folder, domain
        self.sites = f"tls://127.0.0.1:{free_port()}" if sites else ""
        self.authority = self.certificate = self.key = ""
        if sites:
            authority = Authority(folder, lambda: ["127.0.0.1"])
            authority.renew()
            self.certificate, self.key = map(str, authority.files)
            self.authority = authority.file.read_text()

    def start(self) -> None:
        store = self.folder / "broker"
        store.mkdir(exist_ok=True)
        for name in ("hub.creds", "hub.pem"):
            if (file := self.settings.broker_dir / name).exists():
                (store / name).write_bytes(file.read_bytes())
        config = self.folder / "nats.conf"
        config.write_text(
            set_up(
                self.settings,
                f"{'tls' if self.authority else 'nats'}://127.0.0.1:{self.port}",
                self.authority,
                domain=self.domain,
                certificate=self.certificate,
                key_file=self.key,
                folder=str(store),
                sites=self.sites,
            )
        )
        self.process = subprocess.Popen((NATS_SERVER, "-c", str(config)), stderr=subprocess.DEVNULL)
        wait_for(lambda: listens(self.port))

    def accept(self, name: str, kind: MemberKind = MemberKind.MEMBER) -> Credentials:
        key = SigningKey.create(Kind.USER)
        found = self.accounts.accept(name, key.public, "127.0.0.1", kind)
        return replace(found, seed=key.seed)

    def end(self) -> None:
        self.process.kill()
        self.process.wait()


@pytest.fixture
def hub(tmp_path: Path) -> Iterator[Hub]:
    running = Hub(tmp_path / "hub", "hub", sites=True)
    running.start()
    yield running
    running.end()


@contextlib.asynccontextmanager
async def connected(credentials: Credentials, cell: str = "") -> AsyncIterator[Connected]:
    found = await Connected().connect(credentials, answer_subject(cell) if cell else "_INBOX")
    try:
        yield found
    finally:
        await found.client.close()


FORBIDDEN = (
    "arcor2hw.fleet.oven.state", "arcor2hw.fleet.oven.unit", "arcor2hw.fleet.oven.answer.1", "arcor2.press-3.open",
    "_INBOX.any.1", "$JS.API.STREAM.CREATE.ARCOR2_HW_FLEET_press-3", "$JS.API.STREAM.CREATE.ARCOR2_HW_FLEET_oven",
    "$JS.API.STREAM.DELETE.ARCOR2_HW_FLEET_oven", "$JS.API.STREAM.MSG.GET.ARCOR2_HW_FLEET_oven",
    "$JS.API.CONSUMER.CREATE.ARCOR2_HW_FLEET_oven", "$JS.hub.API.STREAM.DELETE.ARCOR2_HW_FLEET_oven",
    "$JS.ACK.ARCOR2_HW_FLEET_oven.fleet.1.1.1.1.1", "$SYS.REQ.CLAIMS.UPDATE",
)  # fmt: skip


@pytest.mark.parametrize("remote_page", [False, True])
async def test_a_cell_publishes_only_under_its_own_name(hub: Hub, remote_page: bool) -> None:
    """The page's server has the same rights on the computer of the broker and elsewhere."""
    received: list[str] = []

    async def receive(message: Msg) -> None:
        received.append(message.subject)

    page = hub.accept("page", MemberKind.PAGE) if remote_page else load(hub.settings.broker_credentials)
    async with connected(page) as page_client, connected(hub.accept(CELL), CELL) as press:
        stream = page_client.client.jetstream(domain="hub")
        for cell in ("oven", CELL):
            await stream.add_stream(name=stream_name(cell), subjects=[f"arcor2hw.fleet.{cell}.unit"])
        await page_client.client.subscribe("arcor2hw.fleet.*.state", cb=receive)
        await confirm_sent(page_client.client)
        for subject in FORBIDDEN:
            await press.client.publish(subject, b"x")
        for subject in ("arcor2hw.fleet.*.state", "arcor2hw.fleet.oven.>", ">", "_INBOX.>", "arcor2hw.fleet.press-3.>"):
            await press.client.subscribe(subject, cb=receive)
        await press.client.publish(state_subject(CELL), b"x")
        own = press.client.jetstream()
        assert (await own.account_info()).domain == "hub"
        assert (await own.publish("arcor2hw.fleet.press-3.unit", b"x")).stream == stream_name(CELL)
        # A broker answers a cell on any subject, also on one that deletes the stream of another cell.
        deletion = "$JS.API.STREAM.DELETE.ARCOR2_HW_FLEET_oven"
        await press.client.publish("arcor2hw.fleet.press-3.unit", b"", reply=deletion)
        await press.client.publish("$JS.API.INFO", b"", reply=deletion)
        await reached(lambda: len(press.errors), len(FORBIDDEN) + 5)
        await reached(lambda: len(received), 1)
        assert (await stream.stream_info(stream_name("oven"))).state.messages == 0
        assert received == [state_subject(CELL)]
        assert all("permissions violation" in each for each in press.errors)
        # The server of the page may not send commands.
        for subject in ("arcor2hw.fleet.press-3.state", "arcor2.press.open", "$JS.API.STREAM.DELETE.X"):
            await page_client.client.publish(subject, b"x")
        await reached(lambda: len(page_client.errors), 3)


async def reached(read: Callable[[], int], expected: int) -> None:
    """Wait until a number is reached. Clients send what they have published after a ping."""
    async with asyncio.timeout(WITHIN):
        while read() < expected:
            await asyncio.sleep(0.02)
    assert read() == expected


async def test_a_site_delivers_states_and_results_and_is_revoked(hub: Hub, tmp_path: Path) -> None:
    site = Hub(tmp_path / "brno", "brno")
    save_hub(site.settings, "brno", hub.accept("brno", MemberKind.SITE))
    with pytest.raises(Conflict, match="Use --domain brno"):
        set_up(site.settings, site.sites, "", domain="hub", certificate="", key_file="", folder="/unused")
    site.start()
    fleet = FleetProcess("", hub.settings.data_dir)
    storage = await Storage.open(ServerSettings(data_dir=tmp_path))
    paired = site.accept(CELL)
    cell = SmallCell(storage, paired, "brno")
    try:
        await cell.units.put([unit(1)])
        await until(fleet.numbers, [1])
        alive = lambda: [each["alive"] for each in fleet.cells()]  # noqa: E731
        await until(alive, [True])
        # A revoked site has no signal. It stores its results until it is accepted again.
        await hub.accounts.revoke("brno")
        await until(alive, [False])
        await cell.units.put([unit(2)])
        await cell.sent()
        site.end()
        save_hub(site.settings, "brno", hub.accept("brno", MemberKind.SITE))
        site.start()
        await until(fleet.numbers, [1, 2])
        # The site revokes its cells itself.
        await site.accounts.revoke(CELL)
        await until(alive, [False])
    finally:
        await cell.close()
        await storage.close()
        fleet.kill()
        site.end()


# ---------------------------------------------------------------------------------------------------- command line
async def test_the_page_is_served_by_another_computer(hub: Hub, tmp_path: Path) -> None:
    """It is paired again after a revocation, without being restarted."""
    page = ServerSettings(data_dir=tmp_path / "page")

    def pair() -> None:
        run, printed = paired_by_commands("fleet", "page", hub.settings.data_dir, page.data_dir, "--page")
        assert run.startswith("Run on the computer of the page: ")
        assert printed.endswith("arcor2-hw fleet serve\n")

    await asyncio.to_thread(pair)
    assert paired_page(page).stat().st_mode & 0o077 == 0
    assert not page.broker_credentials.exists()
    with pytest.raises(Conflict, match=r"page is the server of the page already.* fleet revoke page"):
        hub.accounts.check_new("second", MemberKind.PAGE)
    fleet = FleetProcess("", page.data_dir)
    storage = await Storage.open(ServerSettings(data_dir=tmp_path))
    cell = SmallCell(storage, hub.accept(CELL), "hub")
    try:
        await cell.units.put([unit(1)])
        await until(fleet.numbers, [1])
        alive = lambda: [each["alive"] for each in fleet.cells()]  # noqa: E731
        await until(alive, [True])
        await hub.accounts.revoke("page")
        await until(alive, [False])
        await cell.units.put([unit(2)])
        await cell.sent()
        await asyncio.to_thread(pair)
        await until(fleet.numbers, [1, 2])
        await until(alive, [True])
    finally:
        await cell.close()
        await storage.close()
        fleet.kill()


def test_a_technician_pairs_lists_and_revokes(hub: Hub, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    for name, options, saved in (
        (CELL, (), "fleet/press-3.json"),
        ("brno", ("--site",), "broker/hub.creds"),
        ("screen", ("--page",), "broker/page.json"),
    ):
        paired_by_commands("fleet", name, hub.settings.data_dir, tmp_path / name, *options)
        assert (tmp_path / name / saved).stat().st_mode & 0o077 == 0
    assert ServerSettings(data_dir=tmp_path / CELL, cell_name=CELL).in_fleet
    assert not ServerSettings(data_dir=tmp_path / CELL, cell_name="press-4").in_fleet
    capfd.readouterr()
    assert cli.list_members(data_dir=hub.settings.data_dir) == ExitStatus.OK
    listed = [line.split()[:2] for line in capfd.readouterr().out.splitlines()[1:]]
    assert listed == [["brno", "site"], [CELL, "cell"], ["screen", "page"]]
    assert cli.revoke(CELL, data_dir=hub.settings.data_dir) == ExitStatus.OK
    assert cli.revoke(CELL, data_dir=hub.settings.data_dir) == ExitStatus.NOT_FOUND
    assert "arcor2-hw fleet: press-3 has not been accepted." in capfd.readouterr().err
    assert cli.accept("press 3", data_dir=hub.settings.data_dir) == ExitStatus.USAGE
    assert cli.accept("other", site=True, page=True, data_dir=hub.settings.data_dir) == ExitStatus.USAGE
    assert cli.accept("other", page=True, data_dir=hub.settings.data_dir) == ExitStatus.CONFLICT
