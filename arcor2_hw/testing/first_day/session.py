"""Session: lead a person through the first day with one real device, and write the report after each step."""

import contextlib
import random
import signal
import time
import traceback
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Final

import msgspec

from arcor2_hw.data.base import Unset
from arcor2_hw.data.device import Identity
from arcor2_hw.data.robot import Power
from arcor2_hw.exceptions import Arcor2Error, NotConnected
from arcor2_hw.objects import Generic, Robot
from arcor2_hw.testing import capabilities, report
from arcor2_hw.testing.bench import obstacle
from arcor2_hw.testing.cell_bench import all_settings
from arcor2_hw.testing.first_day import plan
from arcor2_hw.testing.first_day.bench import RealBench
from arcor2_hw.testing.first_day.person import Interrupted, Person
from arcor2_hw.testing.first_day.readings import readings_of
from arcor2_hw.testing.first_day.recorder import Recorder, forms, redacted
from arcor2_hw.testing.outcomes import Kind
from arcor2_hw.testing.quality import FILE
from arcor2_hw.testing.report import EVIDENCE, CaseResult, DeviceRun
from arcor2_hw.testing.time_limit import CallHangs, within

REPORT: Final = "report.json"
RELEASE_TIMEOUT: Final = 15.0
"""Time in which the objects of a case are disconnected, s."""
BEFORE: Final = (
    "This program and its stops are not safety functions. They do not replace a risk assessment, guards or an enabling "
    "switch.",
    "The emergency stop of the device is within your reach, and you have tried it.",
    "No person or object is in the space that the device can reach, and no other client uses the device.",
)
MAX_SHOWN: Final = 240
"""Maximum length of a reading that is shown."""
LOSS: Final = "Connection loss"
DECLINED: Final = "declined by the person at the device"
INTERRUPTED: Final = "interrupted by the person at the device"
ENDED: Final = "the session ended before"


class Ended(Exception):
    """The session ends early; the message says why."""


class Session:
    """The first day with one device."""

    def __init__(self, bench: RealBench, person: Person, folder: Path) -> None:
        """Store the parts.

        Args:
            bench: The device, not started.
            person: The person at the device.
            folder: An existing folder for report and recording.
        """
        self.bench, self.person, self.folder = bench, person, folder
        bench.person = person
        names = (value for name, value in self._settings().items() if name in ("user", "username", "login"))
        self._secrets = forms(bench.secrets(), [str(each) for each in names])
        self._recorder = Recorder(folder, self._secrets)
        self._cases: dict[str, CaseResult] = {}
        self._identity = Identity("", "", "", "")
        self._limits: dict[str, Any] = {}
        self._current = ""
        self._powered = False
        self._sources = report.digest(bench.quality_file().parent)

    # -------------------------------------------------------------------------------- whole description
    def run(self) -> bool:
        """Execute all steps; return whether no case failed.

        Raises:
            Arcor2Error: The device cannot be connected.
            KeyboardInterrupt: The person ended the session. The device is stopped and disconnected.
        """
        try:
            self._steps()
        except (KeyboardInterrupt, Interrupted):
            signal.signal(signal.SIGINT, signal.SIG_IGN)
            self.person.say("Stopping the device and disconnecting.", "warning")
            self._interrupt()
            raise
        except Ended as error:
            self.person.say(str(error), "warning")
        except Exception as error:
            # A driver may raise unexpected errors; the device is stopped in any case.
            self.person.say(self._clean(f"{_reason(error)} {getattr(error, 'detail', '')}".strip()), "bad")
            self._interrupt()
            raise
        finally:
            self._finish()
        return self._count(Kind.FAILED) == 0

    def _steps(self) -> None:
        person, day = self.person, self.bench.day
        person.say(_title(self.bench), "heading")
        self._list([*BEFORE, *day.before])
        if not person.confirm("Is all of this done?"):
            raise Ended("Nothing was connected. Start again when all of it is done.")
        try:
            within(RELEASE_TIMEOUT, self.bench.start, "the start of the wire")
        except OSError as error:
            raise NotConnected(
                "{name}: {address} cannot be opened: {reason}. Check cable and power.",
                name=self.bench.entry.name,
                address=self.bench.real_address,
                reason=error.strerror or error,
            ) from error
        self._read()
        first, *others = plan.GROUPS
        self._group(first)
        self._confirm_limits()
        if day.ready:
            person.say("Before the driver takes control", "heading")
            self._list(day.ready)
            if not person.confirm("Is all of this done?"):
                raise Ended("The driver took no control. Start again when all of it is done.")
        for group in others:
            self._group(group)

    def _list(self, lines: Iterable[str]) -> None:
        for line in lines:
            self.person.say(f"- {line}")

    def _interrupt(self) -> None:
        self.bench.interrupt()
        if self.bench.wire is not None:
            self._recorder.add(self._current, self.bench.wire.record())
        with contextlib.suppress(CallHangs):
            within(RELEASE_TIMEOUT, self.bench.release, "disconnecting")
        if self._current in plan.ALL:
            self._cases.setdefault(self._current, CaseResult(Kind.NOT_RUN, INTERRUPTED))

    def _finish(self) -> None:
        for case in plan.ALL:
            self._cases.setdefault(case, CaseResult(Kind.NOT_RUN, ENDED))
        with contextlib.suppress(CallHangs, Arcor2Error):
            within(RELEASE_TIMEOUT, self.bench.end, "removing the wire")
        self._write()
        person = self.person
        person.say("Report", "heading")
        failed = [[case, each.reason] for case, each in self._cases.items() if each.result is Kind.FAILED]
        not_run = [
            [case, each.reason] for case, each in self._cases.items() if each.result not in (Kind.PASSED, Kind.FAILED)
        ]
        for rows, columns in ((failed, ["failed", "reason"]), (not_run, ["not run", "reason"])):
            if rows:
                person.show(columns, rows)
        counts = f"{self._count(Kind.PASSED)} cases passed, {len(failed)} failed, {len(not_run)} were not run."
        person.say(counts, "bad" if failed else "good")
        person.say(f"The report is {self.folder / REPORT}.")
        if self.bench.real:
            person.say(
                f"As evidence, copy the folder to {self.bench.quality_file().parent / EVIDENCE}. In {FILE}, name the "
                "report under `report`, and model and firmware under `versions_tried`, `hardware`."
            )
        else:
            person.say("The device is on this machine, so the report cannot be used as evidence.", "warning")

    # -------------------------------------------------------------------------------- reading
    def _read(self) -> None:
        """Connect, show everything that can be read, and disconnect. Nothing may act on the device."""
        bench, person = self.bench, self.person
        self._current = "reading"
        person.say("Readings of the device", "heading")
        began = time.monotonic()
        device = within(bench.case_within, bench.connected, "connecting")
        connected = time.monotonic() - began
        self._identity = within(bench.case_within, device.identify, "identify")
        rows = [
            *([name, value or "unknown"] for name, value in msgspec.structs.asdict(self._identity).items()),
            ["connected in", f"{connected:.2f} s"],
            ["health", str(device.health)],
            ["control", device.control_owner() or "nobody"],
            *(["alarm", f"{alarm.code}: {alarm.text}"] for alarm in device.alarms()),
            *self._readings(device),
        ]
        person.show(["", self._clean(bench.real_address)], [[name, self._clean(text)] for name, text in rows])
        acted = list(bench.actuating()) if bench.has("actuating") else None
        self._release("reading")
        if acted:
            raise Ended(f"The driver should only observe, but it sent {'; '.join(acted[:5])}. Nothing else is tried.")
        if acted is None:
            person.say("Whether the driver only reads cannot be seen, because its frames are not declared.", "warning")
        else:
            person.say("The recording of the wire contains no frame that acts on the device.", "good")
        if (
            isinstance(device, Robot)
            and self._powered
            and not person.confirm("The drives are powered. It is safer with the brakes on. Go on nevertheless?")
        ):
            raise Ended("Switch the drives off, then start again.")

    def _readings(self, device: Generic) -> list[list[str]]:
        rows = []
        for name in capabilities.readable(type(device), capabilities.declared(type(device))):
            if name in ("identify", "alarms"):
                continue
            try:
                value = within(self.bench.case_within, getattr(device, name), name)
            except Arcor2Error as error:
                value = error
            self._powered |= getattr(value, "power", None) is Power.OPERATIONAL
            rows.append([name, _shown(value)])
        with contextlib.suppress(Arcor2Error):
            rows += [[name, text] for name, text, _ in readings_of(device, self.bench.reading)]
        return rows

    # -------------------------------------------------------------------------------- limits
    def _settings(self) -> dict[str, Any]:
        return all_settings(self.bench.entry, self.bench.object_type)

    def _confirm_limits(self) -> None:
        person, day = self.person, self.bench.day
        person.say("Limits", "heading")
        settings, described = self._settings(), self.bench.described_settings
        rows = [[name, str(settings[name]), _text(described[name].description)] for name in day.limits]
        if rows:
            person.show(["setting", "value", ""], rows)
        if day.device_limits:
            person.say("In the device itself:")
            self._list(day.device_limits)
        if not rows and not day.device_limits:
            person.say("No limits are declared for this device.")
        if not person.confirm("Are these limits right for the first motions?"):
            raise Ended(f"Correct the limits in the device, and the settings in {self.bench.file}. Then start again.")
        self._limits = {name: settings[name] for name in day.limits}

    # -------------------------------------------------------------------------------- cases
    def _group(self, group: plan.Group) -> None:
        bench, person = self.bench, self.person
        person.say(group.title, "heading")
        person.say(group.text)
        bench.by_hand = False
        first = group is plan.GROUPS[0]
        if group.title == LOSS and person.confirm("Do you want to pull the cable by hand, where this is possible?"):
            bench.by_hand = True
        runnable = []
        for case in group.cases:
            found = obstacle(bench, plan.case(case), case)
            if found is None:
                runnable.append(case)
            else:
                self._record(case, *found)
        if not runnable:
            person.say("No case of this group can be run on this device.")
            return
        if not first:
            self._list(plan.summary(case) for case in runnable)
            if not person.confirm(f"Run the group {group.title!r}?"):
                for case in runnable:
                    self._record(case, Kind.NOT_RUN, DECLINED)
                return
        for case in runnable:
            self._case(case)
            if self._cases[case].result is Kind.FAILED and not person.confirm("The case failed. Go on?"):
                raise Ended("The session ends here, because a case failed.")

    def _case(self, case: str) -> None:
        bench, person = self.bench, self.person
        self._current = case
        executed = plan.acts(case, bench.object_type, bench.day.ask)
        if executed:
            person.say(f"{case}: {plan.summary(case)}")
            for which in executed:
                self._ask_arguments(which)
                person.say(f"  {bench.moves(which)}", "warning")
            if not person.confirm("Run this case?"):
                self._record(case, Kind.NOT_RUN, DECLINED)
                self._current = ""
                return
        began = time.monotonic()
        try:
            within(bench.case_within, lambda: self._call(case), f"the case {case}")
        except CallHangs as error:
            self._record(case, Kind.FAILED, str(error), time.monotonic() - began)
            self._release(case)
            raise Ended(f"{error}. The session ends here. Switch the device off before you go on.") from None
        except Exception as error:  # noqa: BLE001 - also of a faulty driver
            bench.stop_all()
            self._record(case, Kind.FAILED, _reason(error), time.monotonic() - began)
        else:
            self._record(case, Kind.PASSED, "", time.monotonic() - began)
        self._release(case)
        self._current = ""

    def _call(self, case: str) -> None:
        function = plan.case(case)
        phases = {"arcor2_phases": random.SystemRandom()} if case == "stop_at_random_phases" else {}
        function(arcor2_bench=self.bench, **phases)

    def _ask_arguments(self, which: str) -> None:
        motion = getattr(self.bench.day, which, None)
        if motion is None or isinstance(motion, Unset) or which in self.bench.asked:
            return
        if motion.asked:
            self.bench.asked[which] = {name: self.person.ask(question) for name, question in motion.asked.items()}

    def _release(self, case: str) -> None:
        """Record the traffic of a case, disconnect its objects and heal the wire."""
        if self.bench.wire is not None:
            self._recorder.add(case, self.bench.wire.record())
        within(RELEASE_TIMEOUT, self.bench.release, f"disconnecting after {case}")
        within(self.bench.case_within, self.bench.reset, f"the reset after {case}")
        self._write()

    # -------------------------------------------------------------------------------- report
    def _clean(self, text: str) -> str:
        return redacted(text, self._secrets)

    def _record(self, case: str, kind: Kind, reason: str = "", seconds: float = 0.0) -> None:
        self._cases[case] = CaseResult(kind, self._clean(reason), round(seconds, 3))
        style = {Kind.PASSED: "good", Kind.FAILED: "bad"}.get(kind, "text")
        self.person.say(f"{case}: {kind}{': ' * bool(reason)}{self._clean(reason)}", style)

    def _count(self, kind: Kind) -> int:
        return sum(each.result is kind for each in self._cases.values())

    def _write(self) -> None:
        bench = self.bench
        distribution, version = report.origin(bench.type_name())
        run = DeviceRun(
            device=bench.entry.name,
            type=bench.type_name(),
            real=bench.real,
            address=self._clean(bench.real_address),
            identity=self._identity,
            distribution=distribution,
            version=version,
            libraries=report.libraries(distribution),
            cases=dict(sorted(self._cases.items())),
            sources=self._sources,
            limits=self._limits,
            recording=self._recorder.recording(),
        )
        report.write_runs(self.folder / REPORT, [run])


def show_plan(bench: RealBench, person: Person) -> None:
    """Show what a session would do, without connecting the device."""
    bench.lay_wire()
    person.say(_title(bench), "heading")
    for title, lines in (
        ("Before you connect it", [*BEFORE, *bench.day.before]),
        ("Limits in its settings", bench.day.limits),
        ("Limits in the device itself", bench.day.device_limits),
        ("Before the driver takes control", bench.day.ready),
    ):
        if lines:
            person.say(title, "heading")
            for line in lines:
                person.say(f"- {line}")
    rows = []
    for group in plan.GROUPS:
        for case in group.cases:
            found = obstacle(bench, plan.case(case), case)
            motions = [bench.moves(which) for which in plan.acts(case, bench.object_type, bench.day.ask)]
            rows.append([group.title, case, f"not run: {found[1]}" if found else " ".join(motions)])
    person.show(["group", "case", "motion"], rows)


def _shown(value: Any) -> str:
    """Return a reading as text in one or two lines."""
    if isinstance(value, msgspec.Struct):
        value = "; ".join(f"{name}: {_shown(each)}" for name, each in msgspec.structs.asdict(value).items())
    elif isinstance(value, dict):
        value = "; ".join(f"{name}: {_shown(each)}" for name, each in value.items())
    elif isinstance(value, list | tuple | set | frozenset):
        value = ", ".join(map(_shown, value)) or "none"
    elif isinstance(value, float):
        value = f"{value:.4g}"
    text = str(value)
    return text if len(text) <= MAX_SHOWN else f"{text[:MAX_SHOWN]} …"


def _title(bench: RealBench) -> str:
    return f"First day with {bench.entry.name} ({bench.type_name()}) at {bench.real_address}"


def _text(value: str | Unset) -> str:
    return "" if isinstance(value, Unset) else value


def _reason(error: Exception) -> str:
    text = str(error).strip()
    if isinstance(error, AssertionError | Arcor2Error | CallHangs) and text:
        return text
    place: Sequence[traceback.FrameSummary] = traceback.extract_tb(error.__traceback__)[-1:]
    where = "".join(f" ({Path(frame.filename).name}, line {frame.lineno}: {frame.line})" for frame in place)
    return f"{type(error).__name__}: {text}{where}"


# Names before version 0.2.
RELEASE_WITHIN = RELEASE_TIMEOUT
