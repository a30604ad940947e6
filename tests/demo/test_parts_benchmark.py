"""The demo cell with random faults, kills included, and an operator who resolves each of them."""

from pathlib import Path

import pytest

from benchmarks.parts import trial

pytestmark = [pytest.mark.asyncio, pytest.mark.timeout(300)]
SEED = 4
BOARDS, FAULTS = 4, 10


@pytest.mark.matrix  # the faults one by one are in tests/e2e
async def test_every_board_is_accounted_for_and_reported_once(tmp_path: Path) -> None:
    result = await trial(tmp_path / "cell", SEED, BOARDS, FAULTS)
    assert result.problems() == []
    assert result.faults.total() == FAULTS
    assert result.holds > 0 < result.kills
