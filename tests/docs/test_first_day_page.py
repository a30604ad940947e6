"""The page about the first day with each device matches the declarations of the drivers."""

from tests.docs.first_day_page import PAGE, page


def test_the_page_matches_the_declarations() -> None:
    assert PAGE.read_text() == page(), "write it with python -m tests.docs.first_day_page"
