"""Report: results of the suite on real devices as evidence for level gold, and their check against a claim."""

import importlib.metadata
import platform
import re
from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from pathlib import Path

import msgspec

from arcor2_hw.analysis import installed_types
from arcor2_hw.data.base import Data, Timestamp, now
from arcor2_hw.data.device import Identity
from arcor2_hw.testing.outcomes import Kind, Outcomes, Ran
from arcor2_hw.testing.quality import Quality


class CaseResult(Data, frozen=True):
    """Result of one case, with the reason if it did not pass."""

    result: Kind
    reason: str = ""


class DeviceRun(Data, frozen=True):
    """The cases on one device. `distribution`, `version`: of the driver. `libraries`: versions of imported ones."""

    device: str
    type: str
    real: bool
    address: str
    identity: Identity
    distribution: str
    version: str
    libraries: dict[str, str]
    cases: dict[str, CaseResult]


class Report(Data, frozen=True):
    """One run of the suite."""

    written: Timestamp
    suite: str
    python: str
    system: str
    devices: list[DeviceRun]


def origin(type_name: str) -> tuple[str, str]:
    """Return the distribution of a type and its version; empty when it is not installed."""
    for each in installed_types():
        if each.name == type_name:
            return each.distribution, each.version
    return "", ""


def _libraries(distribution: str) -> dict[str, str]:
    """Return the installed versions of the requirements of a distribution."""
    found = {}
    try:
        required = importlib.metadata.requires(distribution) or [] if distribution else []
    except importlib.metadata.PackageNotFoundError:
        return {}
    for each in required:
        name = re.split(r"[^A-Za-z0-9._-]", each, maxsplit=1)[0]
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    return dict(sorted(found.items()))


def _run(name: str, ran: Ran) -> DeviceRun:
    distribution, version = origin(ran.type_name)
    cases = {case: CaseResult(kind, reason) for case, (kind, reason) in sorted(ran.outcomes.items())}
    identity = Identity(**ran.identity)
    libraries = _libraries(distribution)
    return DeviceRun(name, ran.type_name, ran.real, ran.address, identity, distribution, version, libraries, cases)


def write(path: Path, outcomes: Outcomes) -> None:
    """Write the report of a run.

    Raises:
        OSError: The file cannot be written.
    """
    report = Report(
        now(),
        importlib.metadata.version("arcor2-hw"),
        platform.python_version(),
        f"{platform.system()} {platform.machine()}",
        [_run(name, ran) for name, ran in outcomes.items()],
    )
    path.write_bytes(msgspec.json.format(msgspec.json.encode(report), indent=2) + b"\n")


def unmatched(folder: Path, claims: Quality, type_name: str, outcomes: Mapping[str, tuple[Kind, str]]) -> list[str]:
    """Return a sentence for each reason why the named report is not evidence for gold."""
    if not isinstance(claims.report, str):
        return ["quality.yaml names no report of a --real run"]
    path = folder / claims.report
    try:
        report = msgspec.json.decode(path.read_bytes(), type=Report)
    except FileNotFoundError:
        return [f"the report {claims.report} does not exist"]
    except (OSError, msgspec.DecodeError) as error:
        return [f"the report {claims.report} cannot be read: {error}"]
    runs = [run for run in report.devices if run.type == type_name and run.real]
    if not runs:
        return [f"the report {claims.report} has no run on a real {type_name}"]
    return _of_a_run(runs[0], report, claims, outcomes)


def _of_a_run(run: DeviceRun, report: Report, claims: Quality, outcomes: Mapping[str, tuple[Kind, str]]) -> list[str]:
    wrong = []
    if datetime.fromisoformat(report.written) > datetime.now(UTC) + timedelta(days=1):
        wrong.append(f"the report is of the future ({report.written})")
    if not run.identity.firmware or not run.identity.model:
        wrong.append("the report does not say model and firmware of the device")
    tried = claims.versions_tried.hardware
    tried = [tried] if isinstance(tried, str) else tried
    if not any(run.identity.model in each and run.identity.firmware in each for each in tried):
        wrong.append(
            f"versions_tried.hardware does not name {run.identity.model} with firmware {run.identity.firmware}"
        )
    if run.version != origin(run.type)[1]:
        wrong.append(f"the report is of version {run.version or 'unknown'} of the driver")
    for case, (kind, _) in sorted(outcomes.items()):
        there = run.cases.get(case)
        if there is None or (kind is Kind.PASSED and there.result is not Kind.PASSED):
            wrong.append(f"{case} is {'not in the report' if there is None else there.result + ' there'}")
    return wrong
