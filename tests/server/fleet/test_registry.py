"""Which cells the fleet shows, without a broker: signals, conflicts, limits, and refused messages."""

import msgspec
import pytest

from arcor2_hw.data.base import now
from arcor2_hw.exceptions import Conflict, InvalidData, NotFound
from arcor2_server.fleet import records
from arcor2_server.fleet.registry import DUPLICATE_TIMEOUT, MAX_PER_NAME, SILENT_AFTER, FleetCard, Registry, StoredCell
from tests.server.fleet.cells import state_of

A, B = "a" * 32, "b" * 32


def only(registry: Registry) -> FleetCard:
    (card,) = registry.cards()
    return card


def test_a_cell_without_states_has_no_signal_and_returns() -> None:
    registry = Registry()
    registry.accept("press", state_of(number=1), now(), 100.0)
    registry.check(100.0 + SILENT_AFTER)
    assert only(registry).alive
    revision = registry.revision
    registry.check(100.1 + SILENT_AFTER)
    assert not only(registry).alive
    assert [card.alive for card in registry.cards(revision)] == [False]
    registry.accept("press", state_of(number=2), now(), 110.0)
    assert only(registry).alive
    assert SILENT_AFTER + 2 * 0.1 < 2.0  # with the periods of the check and of the update of the page


def test_a_state_without_changes_is_not_sent_to_the_page() -> None:
    registry = Registry()
    registry.accept("press", state_of(number=1), now(), 1.0)
    revision = registry.revision
    registry.accept("press", state_of(number=2), now(), 1.5)
    assert registry.revision == revision
    registry.accept("press", state_of(number=3, good=1), now(), 2.0)
    assert [card.state.good for card in registry.cards(revision)] == [1]


def test_a_state_that_is_delivered_late_is_ignored() -> None:
    registry = Registry()
    registry.accept("press", state_of(number=5, good=5), now(), 1.0)
    registry.accept("press", state_of(number=4, good=4), now(), 3.0)
    assert only(registry).state.good == 5
    registry.check(1.1 + SILENT_AFTER)
    assert not only(registry).alive


def test_two_servers_with_one_name_are_a_conflict_until_one_is_removed() -> None:
    registry = Registry()
    registry.accept("press", state_of(A), now(), 1.0)
    registry.accept("lathe", state_of(B), now(), 1.0)
    assert not any(card.conflict for card in registry.cards())
    registry.accept("press", state_of(B), now(), 1.0)
    assert {card.id: card.conflict for card in registry.cards()} == {
        f"press:{A}": True,
        f"press:{B}": True,
        f"lathe:{B}": False,
    }
    with pytest.raises(Conflict, match="has a signal"):
        registry.remove(f"press:{A}")
    registry.check(10.0)
    revision = registry.revision
    assert registry.remove(f"press:{A}") == ("press", A)
    assert registry.removed(revision) == [f"press:{A}"]
    assert not any(card.conflict for card in registry.cards())
    with pytest.raises(NotFound):
        registry.remove(f"press:{A}")


def test_two_servers_with_the_same_data_conflict_but_a_restart_does_not() -> None:
    registry = Registry()
    registry.accept("press", state_of(boot="1", number=900), now(), 1.0)
    registry.accept("press", state_of(boot="2", number=1), now(), 2.0)
    assert (only(registry).conflict, only(registry).alive) == (False, True)
    registry.accept("press", state_of(boot="1", number=901), now(), 2.1)
    registry.check(2.2)
    assert only(registry).conflict
    registry.check(2.2 + DUPLICATE_TIMEOUT)
    assert not only(registry).conflict


def test_the_number_of_servers_with_one_name_is_limited() -> None:
    registry = Registry()
    for number in range(MAX_PER_NAME):
        registry.accept("press", state_of(f"{number:032x}"), now(), 1.0)
    with pytest.raises(Conflict, match="4 servers use the name"):
        registry.accept("press", state_of("f" * 32), now(), 1.0)


def test_known_cells_have_no_signal_after_a_restart_of_the_fleet() -> None:
    registry = Registry([StoredCell("press", now(), state_of(number=7))])
    assert not only(registry).alive
    registry.accept("press", state_of(number=1), now(), 1.0)  # the cell may have been restarted, too
    assert only(registry).alive


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"{", "truncated"),
        (b"x" * (records.MAX_STATE + 1), "at most 16384"),
        (b"[" * 10_000, "nested too deeply|object"),
        (msgspec.json.encode(state_of(identity="")), "length >= 1"),
        (msgspec.json.encode(state_of(address="javascript:alert(1)")), "regex"),
        (msgspec.json.encode(state_of(domain="a.b")), "regex"),
        (msgspec.json.encode(state_of(users=("eva",) * 9)), "length <= 8"),
        (msgspec.json.encode(state_of(good=-1)), ">= 0"),
    ],
)
def test_an_invalid_state_is_refused(data: bytes, reason: str) -> None:
    with pytest.raises(InvalidData, match=reason):
        records.decode_state(data)
    assert records.decode_state(msgspec.json.encode(state_of())) == state_of()


@pytest.mark.parametrize(
    "subject", ["arcor2hw.fleet.Press.state", "arcor2hw.fleet..state", f"arcor2hw.fleet.{'x' * 64}.state"]
)
def test_a_subject_without_a_valid_name_is_refused(subject: str) -> None:
    with pytest.raises(InvalidData, match="not a name of a cell"):
        records.cell_of(subject)
