"""Check whether one of several conditions is always true, with the cases of the editor's completeness.test.ts."""

import json
from pathlib import Path

import msgspec

from arcor2_hw.data.project import LogicWhen
from arcor2_server.documents.comparisons import Comparison, Comparisons, Reference, cases_of, decoded

CASES = json.loads(Path(__file__).with_name("conditions.json").read_text())


def test_server_and_editor_agree_on_the_coverage_of_conditions() -> None:
    places = {name: Reference(-1, 0, name) for name in CASES["types"]}
    for case in CASES["cases"]:
        tests = []
        for when in msgspec.convert(case["conditions"], list[LogicWhen]):
            compared = [(one, [places[name] for name in one.compared()]) for one in when.comparisons]
            found = tuple(Comparison(what, one.operator, *decoded(one), *other) for one, (what, *other) in compared)
            tests.append(Comparisons(found, when.match))
        used = {what for test in tests for one in test.comparisons for what in one.compared()}
        cases = cases_of(tests, {what: CASES["types"][what.parameter] for what in used})
        found_here = {"known": cases.known, "unused": [*cases.unused], "complete": cases.known and cases.gap is None}
        assert found_here == {key: case[key] for key in found_here}, case["conditions"]
