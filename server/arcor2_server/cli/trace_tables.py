"""Tables of traces: of one run or dry run, and of two side by side."""

from typing import Final

from rich.markup import escape
from rich.table import Table

from arcor2_hw.data.base import Unset
from arcor2_hw.data.run_trace import RunTrace, lanes_of
from arcor2_hw.data.trace_comparison import compare, summarize
from arcor2_server.cli.server_connection import printable
from arcor2_server.cli.tables import console

SHOWN_WAITS: Final = 3
"""Number of waits shown with a trace, longest first."""

MIN_WAIT: Final = 0.001
"""Duration above which a wait is shown, s."""


def _safe(text: str) -> str:
    return escape(printable(text))


def show_trace(trace: RunTrace) -> None:
    """Print the actions of a trace, its cycle time, bottleneck and waits."""
    times = summarize(trace)
    names = {device.id: device.name for device in trace.devices}
    out = console()
    lanes = lanes_of(trace.spans)
    lane = ["lane"] if lanes else []
    table = Table("start", "duration", *lane, "device", "action", "branch", "error", box=None, pad_edge=False)
    for span in trace.spans:
        texts = [names.get(span.device, ""), span.name, span.branch or "", span.error or ""]
        if lanes:
            texts.insert(0, lanes.get(span.lane or "", ""))
        table.add_row(f"{span.start:.3f} s", f"{span.duration:.3f} s", *map(_safe, texts))
    out.print(table if trace.spans else "The run has executed no actions.")
    counts = f", {times.cycles} complete; all: {times.whole:.3f} s" if trace.run else ""
    out.print(f"cycle: {times.cycle:.3f} s{counts}")
    for device in times.devices:
        out.print(f"{_safe(device.name)}: busy {device.busy:.3f} s, {device.share:.0%}")
    for one in times.device_waits[:SHOWN_WAITS]:
        waiting, other = (_safe(names.get(key, key)) for key in (one.device, one.for_device))
        out.print(f"{waiting} waits {one.duration:.3f} s for {other} at {one.start:.3f} s, before {_safe(one.before)}")
    for wait in [wait for wait in times.waits if wait.duration > MIN_WAIT][:SHOWN_WAITS]:
        out.print(f"wait of {wait.duration:.3f} s at {wait.start:.3f} s, before {_safe(wait.before)}")
    if trace.omitted:
        out.print(f"The first {trace.omitted} actions are not stored.")


def show_comparison(first: RunTrace, second: RunTrace, titles: tuple[str, str]) -> None:
    """Print two traces side by side: actions, cycles, and the fraction of time for which each device was busy."""
    old, new = summarize(first), summarize(second)
    names = {device.id: device.name for device in (*first.devices, *second.devices)}
    out = console()
    table = Table("device", "action", *map(_safe, titles), "difference", box=None, pad_edge=False)
    for one in compare(old, new):
        difference = one.difference
        table.add_row(
            _safe(names.get(one.device, "")),
            _safe(one.name),
            *("" if isinstance(value, Unset) else f"{value:.3f} s" for value in (one.first, one.second)),
            "" if difference is None else f"{difference:+.3f} s",
        )
    out.print(table)
    out.print(f"cycle: {old.cycle:.3f} s, {new.cycle:.3f} s, {new.cycle - old.cycle:+.3f} s")
    shares = {device.id: f"{device.share:.0%}" for device in old.devices}
    for device in new.devices:
        before = shares.pop(device.id, "-")
        out.print(f"{_safe(device.name)}: busy {before}, {device.share:.0%}")
    for key, before in shares.items():
        out.print(f"{_safe(names[key])}: busy {before}, -")
