"""Two computers in network namespaces, with a cable between two switches that can be cut.

Neither computer sees its own link go down. Needs root. Everything inside has no connection to real networks.
"""

import os
import subprocess
from types import TracebackType

HUB, NODE = "10.9.0.1", "10.9.0.2"


class CannotIsolate(Exception):
    """This user may not create network namespaces."""


class Cable:
    """A context with the namespaces."""

    def __init__(self) -> None:
        prefix = f"a2n{os.getpid() % 100_000}"
        self._hub, self._node, self._between = (f"{prefix}{each}" for each in "hns")

    @property
    def at_hub(self) -> tuple[str, ...]:
        """Return the beginning of a command that is executed at the hub."""
        return ("ip", "netns", "exec", self._hub)

    @property
    def at_node(self) -> tuple[str, ...]:
        """Return the beginning of a command that is executed at the node."""
        return ("ip", "netns", "exec", self._node)

    def cut(self) -> tuple[str, ...]:
        """Return the command that cuts the cable."""
        return ("ip", "-n", self._between, "link", "set", "m1", "down")

    def heal(self) -> tuple[str, ...]:
        """Return the command that repairs the cable."""
        return ("ip", "-n", self._between, "link", "set", "m1", "up")

    def __enter__(self) -> "Cable":
        hub, node, between = self._hub, self._node, self._between
        try:
            for name in (hub, node, between):
                run("ip", "netns", "add", name)
                run("ip", "-n", name, "link", "set", "lo", "up")
            for number in "12":
                run("ip", "-n", between, "link", "add", f"br{number}", "type", "bridge")
                run("ip", "-n", between, "link", "set", f"br{number}", "up")
            for name, port in ((hub, "p1"), (node, "p2")):
                run("ip", "link", "add", "eth0", "netns", name, "type", "veth", "peer", "name", port, "netns", between)
            run("ip", "-n", between, "link", "add", "m1", "type", "veth", "peer", "name", "m2")
            for port, bridge in (("p1", "br1"), ("m1", "br1"), ("p2", "br2"), ("m2", "br2")):
                run("ip", "-n", between, "link", "set", port, "master", bridge)
                run("ip", "-n", between, "link", "set", port, "up")
            for name, address in ((hub, HUB), (node, NODE)):
                run("ip", "-n", name, "addr", "add", f"{address}/24", "dev", "eth0")
                run("ip", "-n", name, "link", "set", "eth0", "up")
        except (OSError, subprocess.CalledProcessError) as error:
            self._remove()
            raise CannotIsolate(str(error)) from error
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._remove()

    def _remove(self) -> None:
        for name in (self._hub, self._node, self._between):
            subprocess.run(("ip", "netns", "delete", name), capture_output=True, check=False)


def run(*command: str) -> None:
    subprocess.run(command, check=True, capture_output=True)
