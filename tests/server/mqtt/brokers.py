"""MQTT brokers of the tests, each on a free port of 127.0.0.1."""

import shutil
import socket
import subprocess
import sys
from pathlib import Path

from tests.ports import free_port
from tests.waiting import wait_for


def _command(name: str) -> str:
    return shutil.which(name) or f"/usr/sbin/{name}"  # not on the PATH of users other than root


NATS_SERVER = str(Path(sys.executable).with_name("nats-server"))
"""A version that allows dots in topics, as in the namespace of Sparkplug: 2.10 or newer."""


class Broker:
    """A broker that uses the same port after a restart."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.port = folder, free_port()
        self.file = folder / "broker.conf"
        self.command: list[str] = []

    def start(self) -> None:
        with (self.folder / "broker.log").open("ab") as log:
            self.process = subprocess.Popen(self.command, stdout=log, stderr=log)

        def accepts() -> bool:
            assert self.process.poll() is None, (self.folder / "broker.log").read_text()
            with socket.socket() as probe:
                return probe.connect_ex(("127.0.0.1", self.port)) == 0

        wait_for(accepts)

    def end(self) -> None:
        self.process.kill()
        self.process.wait()

    @property
    def url(self) -> str:
        return f"mqtt://127.0.0.1:{self.port}"


class Mosquitto(Broker):
    """mosquitto with further `lines` of its configuration, which also decide which users it admits."""

    def __init__(self, folder: Path, lines: str = "allow_anonymous true") -> None:
        super().__init__(folder)
        user = "user root\n" if Path.home() == Path("/root") else ""
        self.file.write_text(f"listener {self.port} 127.0.0.1\n{user}{lines}\n")
        self.command = [_command("mosquitto"), "-c", str(self.file)]
        self.start()


class Nats(Broker):
    """The MQTT port of nats-server."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.file.write_text(
            f'listen: 127.0.0.1:{free_port()}\nserver_name: test\njetstream {{ store_dir: "{folder}" }}\n'
            f"mqtt {{ listen: 127.0.0.1:{self.port} }}\n"
        )
        self.command = [NATS_SERVER, "-c", str(self.file)]
        self.start()
