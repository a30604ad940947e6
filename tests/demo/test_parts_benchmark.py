"""The demo cell with random faults, including killed processes, and an operator who resolves each fault."""

from pathlib import Path

import pytest

from benchmarks.parts import trial

pytestmark = [pytest.mark.asyncio, pytest.mark.timeout(300)]
SEED = 4
BOARDS, FAULTS = 4, 10


@pytest.mark.matrix  # tests/e2e tests each fault
async def test_every_board_is_accounted_for_and_reported_once(tmp_path: Path) -> None:
    result = await trial(tmp_path / "cell", SEED, BOARDS, FAULTS)
    assert result.problems() == []
    assert result.faults.total() == FAULTS
    assert result.holds > 0 < result.kills
