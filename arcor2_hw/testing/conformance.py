"""Conformance: the cases that every driver has to pass, for each bench of a subclass.

class TestMyDrivers(Conformance):
    benches = (PressBench, OvenBench)
"""

from collections.abc import Iterable
from typing import ClassVar

import pytest

from arcor2_hw.testing.acting_cases import ActingCases
from arcor2_hw.testing.bench import Bench
from arcor2_hw.testing.connecting_cases import ConnectingCases
from arcor2_hw.testing.loss_cases import LossCases
from arcor2_hw.testing.maintenance_cases import MaintenanceCases
from arcor2_hw.testing.outcomes import LEVEL_CASE, Verdict
from arcor2_hw.testing.written_cases import WrittenCases


class Conformance(ActingCases, LossCases, MaintenanceCases, ConnectingCases, WrittenCases):
    """The test cases. A subclass named Test... sets `benches`; each case needs the hooks in its mark."""

    benches: ClassVar[Iterable[type[Bench]]] = ()

    @classmethod
    def benches_of(cls, config: pytest.Config) -> list[type[Bench]]:  # noqa: ARG003 - for subclasses
        """Return the benches of a run; override it for benches that depend on options."""
        return list(cls.benches)

    @classmethod
    def cases(cls) -> frozenset[str]:
        """Return the names of the cases, except the one that judges the level."""
        return frozenset(
            name.removeprefix("test_")
            for base in Conformance.__mro__
            for name in vars(base)
            if name.startswith("test_") and name != f"test_{LEVEL_CASE}"
        )

    def pytest_generate_tests(self, metafunc: pytest.Metafunc) -> None:
        """Run every case on every bench."""
        if "arcor2_running_bench" in metafunc.fixturenames:
            benches = self.benches_of(metafunc.config)
            names = [bench.name() for bench in benches]
            metafunc.parametrize("arcor2_running_bench", benches, indirect=True, ids=names, scope="class")

    def test_level(self, arcor2_running_bench: Bench, arcor2_verdict: Verdict) -> None:
        """The level claimed in quality.yaml is reached; otherwise the failure names what is missing. Runs last."""
        if arcor2_verdict.not_judged:
            pytest.skip(arcor2_verdict.not_judged)
        assert arcor2_verdict.reached >= arcor2_verdict.claimed, (
            f"{arcor2_running_bench.name()} claims level {arcor2_verdict.claimed.name.lower()} and reaches "
            f"{arcor2_verdict.reached.name.lower()}: {'; '.join(arcor2_verdict.missing)}"
        )
