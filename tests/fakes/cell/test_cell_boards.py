"""The boards of a run depend only on its seed."""

from hypothesis import given, strategies as st

from arcor2_fakes.cell.boards import draw_boards

SEEDS = st.integers(-(2**63), 2**63)


@given(count=st.integers(2, 40), seed=SEEDS)
def test_a_seed_gives_the_same_boards_with_good_and_bad_ones(count: int, seed: int) -> None:
    boards = draw_boards(count, seed)
    assert boards == draw_boards(count, seed)
    assert len({board.code for board in boards}) == count
    assert {board.defect is None for board in boards} == {True, False}


@given(count=st.integers(0, 20), seed=SEEDS)
def test_codes_do_not_depend_on_the_random_defects(count: int, seed: int) -> None:
    codes = [board.code for board in draw_boards(count, seed)]
    assert codes == [board.code for board in draw_boards(20, seed)][:count]


def test_seeds_differ_and_every_defect_occurs() -> None:
    drawn = [draw_boards(5, seed) for seed in range(200)]
    assert len({tuple(board.defect for board in boards) for boards in drawn}) > 50
    assert {board.defect for boards in drawn for board in boards} == {None, "short", "open", "leakage"}
    bad = sum(board.defect is not None for boards in drawn for board in boards)
    assert 200 < bad < 500
    for place in range(5):  # no place in the stack predicts the quality of a board
        assert 20 < sum(boards[place].defect is not None for boards in drawn) < 120
