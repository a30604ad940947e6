"""Answers, kept as long as what they were made from stays the same."""

from msgspec import Raw


class KeptAnswers:
    """Answers by request; each is valid for one state of its sources, which their revisions stand for."""

    def __init__(self) -> None:
        self._answers: dict[str, tuple[tuple[int, ...], Raw]] = {}

    def get(self, name: str, revisions: tuple[int, ...]) -> Raw | None:
        """Give a kept answer, None when it was made from something older."""
        kept = self._answers.get(name)
        return kept[1] if kept is not None and kept[0] == revisions else None

    def keep(self, name: str, revisions: tuple[int, ...], encoded: bytes) -> Raw:
        """Keep an encoded answer made from these revisions, taken before its sources were read."""
        answer = Raw(encoded)
        self._answers[name] = (revisions, answer)
        return answer
