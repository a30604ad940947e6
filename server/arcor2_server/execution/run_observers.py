"""Hooks with which other parts of the server check and follow runs."""

from collections.abc import Awaitable, Callable

from arcor2_hw.data.held import HoldDecidedData
from arcor2_hw.runtime import messages as m
from arcor2_server.execution.runs import RunStart
from arcor2_server.hosts.group import HostGroup


class RunObservers:
    """Functions that are called before and during runs. Other parts append theirs."""

    def __init__(self) -> None:
        self.on_error: list[Callable[[m.ErrorData, int, str], None]] = []
        """Called with the error that ends or holds a program, before its devices are gone, the run, and the action."""
        self.on_failed: list[Callable[[int, m.ErrorData | None, HostGroup | None], None]] = []
        """Called with each run that has failed or was interrupted, the reason, and its host, which ends."""
        self.on_decided: list[Callable[[HoldDecidedData], None]] = []
        """Called with each decision about a held program."""
        self.before_start: list[Callable[[RunStart], None]] = []
        """Called before a program is started, and again when it starts; each may raise RequestRefused."""
        self.before_resume: list[Callable[[], None]] = []
        """Called before a paused program is resumed or stepped; each may raise RequestRefused."""
        self.before_run: list[Callable[[str, RunStart], Awaitable[RunStart]]] = []
        """Called with a package and the options of its run, which it may change; may raise RequestRefused."""
        self.on_begin: list[Callable[[int, str, str, RunStart], None]] = []
        """Called with the number of a new run, its package, its scene, and its options."""
        self.on_state: list[Callable[[], None]] = []
        """Called after each change of `state` and `hold`."""
        self.on_part_step: list[Callable[[m.PartStep], None]] = []
        """Called with each report of an action that concerned a part."""
        self.on_action_end: list[Callable[[int], None]] = []
        """Called with the number of each action that has ended or failed."""
        self.on_device_action: list[Callable[[str], None]] = []
        """Called with the id of the object of each action that starts."""
