"""Report: results of the suite on real devices as evidence for level gold, and their check against a claim."""

import hashlib
import importlib.metadata
import platform
import re
from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import msgspec
from msgspec import field

from arcor2_hw.analysis import installed_types
from arcor2_hw.data.base import Data, Timestamp, now
from arcor2_hw.data.device import Identity
from arcor2_hw.testing.outcomes import RECOVERY, Kind, Outcomes, Ran
from arcor2_hw.testing.quality import FILE, Quality

EVIDENCE: Final = "evidence"
"""Folder in that of a driver for reports and recordings."""
NOT_SOURCES: Final = frozenset({FILE, "first_day.yaml"})
"""Files of a driver that are claims and instructions. They do not change what the driver does."""


class CaseResult(Data, frozen=True):
    """Result of one case, with the reason if it did not pass, and its duration, s."""

    result: Kind
    reason: str = ""
    seconds: float = 0.0


class Recording(Data, frozen=True):
    """A recording of the wire: name of the file, next to the report, and SHA-256 of its content."""

    file: str
    sha256: str


class DeviceRun(Data, frozen=True):
    """The cases on one device.

    Attributes:
        distribution: Distribution of the driver.
        version: Version of the distribution.
        sources: Digest of the files of the driver, see `digest`.
        libraries: Versions of the libraries that the distribution requires.
        limits: Settings that limit the device, with the values that a person confirmed.
    """

    device: str
    type: str
    real: bool
    address: str
    identity: Identity
    distribution: str
    version: str
    libraries: Mapping[str, str]
    cases: dict[str, CaseResult]
    sources: str = ""
    limits: dict[str, Any] = field(default_factory=dict)
    recording: Recording | None = None


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


def digest(folder: Path) -> str:
    """Return the SHA-256 of names and contents of all files of a driver, except claims, evidence and caches."""
    found = hashlib.sha256()
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder)
        if path.is_file() and not {EVIDENCE, "__pycache__"} & set(name.parts) and str(name) not in NOT_SOURCES:
            found.update(f"{name.as_posix()}\0{path.stat().st_size}\0".encode())
            found.update(path.read_bytes())
    return found.hexdigest()


@lru_cache
def libraries(distribution: str) -> Mapping[str, str]:
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
    cases = {
        case: CaseResult(kind, reason, round(ran.seconds.get(case, 0.0), 3))
        for case, (kind, reason) in sorted(ran.outcomes.items())
    }
    return DeviceRun(
        device=name,
        type=ran.type_name,
        real=ran.real,
        address=ran.address,
        identity=Identity(**ran.identity),
        distribution=distribution,
        version=version,
        libraries=libraries(distribution),
        cases=cases,
        sources=digest(Path(ran.folder)) if ran.folder else "",
    )


def write(path: Path, outcomes: Outcomes) -> None:
    """Write the report of a run.

    Raises:
        OSError: The file cannot be written.
    """
    write_runs(path, [_run(name, ran) for name, ran in outcomes.items()])


def write_runs(path: Path, runs: list[DeviceRun]) -> None:
    """Write a report.

    Raises:
        OSError: The file cannot be written.
    """
    report = Report(
        now(),
        importlib.metadata.version("arcor2-hw"),
        platform.python_version(),
        f"{platform.system()} {platform.machine()}",
        runs,
    )
    new = path.with_name(f"{path.name}.new")
    new.write_bytes(msgspec.json.format(msgspec.json.encode(report), indent=2) + b"\n")
    new.replace(path)


def unmatched(folder: Path, claims: Quality, type_name: str, outcomes: Mapping[str, tuple[Kind, str]]) -> list[str]:
    """Return a sentence for each reason why the named report is not evidence for gold."""
    if not isinstance(claims.report, str):
        return ["quality.yaml names no report of a real device"]
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
    run = runs[0]
    return [
        *_of_the_versions(run, report, claims),
        *_of_the_files(run, folder, path.parent),
        *_of_the_cases(run, claims, outcomes),
    ]


def _of_the_versions(run: DeviceRun, report: Report, claims: Quality) -> list[str]:
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
    return wrong


def _of_the_files(run: DeviceRun, driver: Path, evidence: Path) -> list[str]:
    wrong = []
    if run.sources != digest(driver):
        wrong.append("the files of the driver have changed since the report was written")
    if run.recording is not None:
        try:
            found = hashlib.sha256((evidence / run.recording.file).read_bytes()).hexdigest()
        except OSError as error:
            wrong.append(f"the recording {run.recording.file} cannot be read: {error.strerror}")
        else:
            if found != run.recording.sha256:
                wrong.append(f"the recording {run.recording.file} is not the one of the report")
    return wrong


def _of_the_cases(run: DeviceRun, claims: Quality, outcomes: Mapping[str, tuple[Kind, str]]) -> list[str]:
    wrong = [f"{case} has to pass on the real device" for case in sorted(RECOVERY & set(claims.not_on_hardware))]
    for case, (kind, _) in sorted(outcomes.items()):
        there = run.cases.get(case)
        if there is None:
            wrong.append(f"{case} is not in the report")
        elif there.result is Kind.FAILED or (
            kind is Kind.PASSED and there.result is not Kind.PASSED and case not in claims.not_on_hardware
        ):
            wrong.append(f"{case} is {there.result} there")
    return wrong
