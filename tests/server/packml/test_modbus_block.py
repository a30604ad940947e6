"""The Modbus block without a network: frames, the owner of the registers, and damaged files."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, strategies as st

from arcor2_hw.data.cell_state import CellAuthority, CellMode
from arcor2_hw.exceptions import StorageError
from arcor2_server.packml.modbus import ExceptionCode, ModbusRefusal, answer
from arcor2_server.packml.plc import MAX_WAITING, Plc
from arcor2_server.packml.record import CellFile, CellRecord, JobEnd
from arcor2_server.storage.damage_notices import DataDamage
from arcor2_server.websocket.hub import Hub


class Block:
    def __init__(self) -> None:
        self.registers = [0, 0, 0, 0]

    def inputs(self) -> Sequence[int]:
        return [10, 11, 12]

    def holding(self) -> Sequence[int]:
        return self.registers

    def write(self, address: int, values: Sequence[int], peer: str) -> None:
        self.registers[address : address + len(values)] = values


@pytest.mark.parametrize(
    ("request_pdu", "expected"),
    [
        ("04 0001 0002", "04 04 000b 000c"),
        ("06 0002 1234", "06 0002 1234"),
        ("10 0001 0002 04 0005 0006", "10 0001 0002"),
        ("04 0001 0003", "84 02"),  # beyond the block
        ("10 0003 0002 04 0005 0006", "90 02"),
        ("03 0000 0000", "83 03"),
        ("10 0001 0002 04 0005", "90 03"),  # cut off
        ("05 0000 ff00", "85 01"),
    ],
)
def test_each_function_is_executed_or_refused(request_pdu: str, expected: str) -> None:
    block = Block()
    assert answer(bytes.fromhex(request_pdu), block, "") == bytes.fromhex(expected)
    assert block.registers == {"06": [0, 0, 0x1234, 0], "10": [0, 5, 6, 0]}.get(expected[:2], [0, 0, 0, 0])


@given(st.binary(min_size=1, max_size=253))
def test_any_frame_is_answered(request_pdu: bytes) -> None:
    reply = answer(request_pdu, Block(), "")
    assert reply[0] & 0x7F == request_pdu[0] & 0x7F
    assert len(reply) <= 253


class _Cell:
    """A cell that only accepts observers."""

    def __init__(self) -> None:
        self.on_change: list[Any] = []
        self.on_job_end: list[Any] = []


def plc(tmp_path: Path, life_timeout: float = 60.0) -> Plc:
    unused: Any = None
    cell: Any = _Cell()
    return Plc(cell, CellFile(tmp_path / "cell-state.json"), unused, unused, unused, life_timeout)


async def test_a_second_plc_and_too_many_requests_are_refused(tmp_path: Path) -> None:
    block = plc(tmp_path)
    block.write(0, [1, 2, 3, 4], "10.0.0.1")
    with pytest.raises(ModbusRefusal) as refused:
        block.write(0, [9, 9, 9, 9], "10.0.0.2")
    assert refused.value.code is ExceptionCode.BUSY
    assert block.holding() == [1, 2, 3, 4]
    for number in range(5, 4 + MAX_WAITING):
        block.write(3, [number], "10.0.0.1")
    with pytest.raises(ModbusRefusal):
        block.write(3, [100], "10.0.0.1")
    block.write(0, [2, 2, 3, block.holding()[3]], "10.0.0.1")  # the life counter is still accepted


def damage(tmp_path: Path) -> DataDamage:
    return DataDamage(tmp_path, Hub())


async def test_after_a_restart_the_plc_has_no_authority(tmp_path: Path) -> None:
    first, second = (CellFile(tmp_path / "cell-state.json") for _ in range(2))
    first.load(damage(tmp_path))
    assert first.record == CellRecord()
    await first.put(authority=CellAuthority.PLC, mode=CellMode.MANUAL, request=7, job=3, job_end=JobEnd.RUNNING)
    second.load(damage(tmp_path))
    expected = CellRecord(CellMode.MANUAL, CellAuthority.NOBODY, request=7, job=3, job_end=JobEnd.LOST)
    assert second.record == expected


def test_a_damaged_file_is_reported_and_nobody_has_the_authority(tmp_path: Path) -> None:
    (tmp_path / "cell-state.json").write_text("{")
    file, notices = CellFile(tmp_path / "cell-state.json"), damage(tmp_path)
    file.load(notices)
    assert file.record.authority is CellAuthority.NOBODY
    assert "jobs of the PLC are lost" in str(notices.notices[0])


async def test_a_change_that_cannot_be_stored_does_not_take_effect(tmp_path: Path) -> None:
    file = CellFile(tmp_path / "missing" / "cell-state.json")
    with pytest.raises(StorageError, match="missing"):
        await file.put(mode=CellMode.MANUAL)
    assert file.record.mode is CellMode.PRODUCE
