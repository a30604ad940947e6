"""Collected by `pytest --pyargs arcor2_hw.testing --device my_cell.yaml`: the suite on every device of the cell."""

import pytest

from arcor2_hw.exceptions import Arcor2Error
from arcor2_hw.testing.bench import Bench
from arcor2_hw.testing.cell_bench import benches_of_files
from arcor2_hw.testing.conformance import Conformance


class TestCell(Conformance):
    """The cases, for each device in the files of `--device`."""

    @classmethod
    def benches_of(cls, config: pytest.Config) -> list[type[Bench]]:
        """Return a bench for each device."""
        files = config.getoption("--device")
        if not files:
            raise pytest.Collector.CollectError("name a cell.yaml by --device FILE")
        try:
            return benches_of_files(files)
        except Arcor2Error as error:
            raise pytest.Collector.CollectError(f"{error} {error.detail}".strip()) from None
