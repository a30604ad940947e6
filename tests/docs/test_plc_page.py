"""The tables of the page about the PLC match the registers, bits, results and numbers of the server."""

import re
from pathlib import Path

from arcor2_hw.data.packml import MachineCommand, MachineState, UnitMode
from arcor2_server.packml.plc import Holding, Input, Status
from arcor2_server.packml.record import JobEnd, RequestResult
from arcor2_server.packml.states import COMMANDS, STATES

PAGE = (Path(__file__).parents[2] / "docs" / "how-to" / "plc.md").read_text()


def rows(heading: str) -> dict[int, str]:
    """Return the rows of the table with a heading: the number in the first column, and the other cells."""
    table = PAGE.partition(heading)[2].partition("\n|")[2].partition("\n\n")[0]
    return {int(number): rest for number, rest in re.findall(r"^\| (\d+) \| (.*)$", table, re.M)}


def numbered(text: str) -> dict[int, str]:
    """Return the names in a list such as `1 produce, 2 manual`."""
    return {int(number): name.lower() for number, name in re.findall(r"(\d+) (\w+)", text)}


def test_the_page_lists_every_register_bit_and_result() -> None:
    inputs, holding = rows("Input registers"), rows("Holding registers")
    assert list(inputs) == list(Input)
    assert list(holding) == list(Holding)
    assert [1 << bit for bit in rows("Bits of the status")] == [each.value for each in Status]
    assert list(rows("Results:")) == list(RequestResult)
    assert numbered(inputs[Input.STATE]) == {each.value: each.name.lower() for each in sorted(STATES)}
    assert numbered(inputs[Input.MODE]) == {each.value: each.name.lower() for each in UnitMode}
    assert list(numbered(inputs[Input.JOB_END])) == list(JobEnd)
    assert numbered(holding[Holding.COMMAND]) == {each.value: each.name.lower() for each in sorted(COMMANDS)}
    assert {MachineState(each) for each in numbered(inputs[Input.STATE])} == STATES
    assert {MachineCommand(each) for each in numbered(holding[Holding.COMMAND])} == COMMANDS
