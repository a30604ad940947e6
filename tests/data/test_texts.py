"""Length limits of texts: every text of a request has one, and the error names the field and the limit."""

import pytest

from arcor2_hw.data.geometry import Position
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.rpc import AddActionPointArgs, AddObjectToSceneArgs, RegisterUserArgs, UploadPackageArgs
from arcor2_hw.data.texts import LIMITS, NAME, OTHER, VALUE, check_texts
from arcor2_hw.exceptions import InvalidData, TextTooLong


@pytest.mark.parametrize(
    ("args", "field", "limit"),
    [
        (RegisterUserArgs("x" * (NAME + 1)), "user_name", NAME),
        (AddActionPointArgs("point", Position(), "p" * (OTHER + 1)), "parent", OTHER),
        (AddObjectToSceneArgs("a", "T", parameters=[Parameter("n" * 300, "string", '""')]), "name", NAME),
        (AddObjectToSceneArgs("a", "T", parameters=[Parameter("n", "string", "v" * (VALUE + 1))]), "value", VALUE),
        ({"k" * (OTHER + 1): 1}, "A text", OTHER),
    ],
)
def test_too_long_values_are_refused_by_field_and_limit(args: object, field: str, limit: int) -> None:
    with pytest.raises(TextTooLong, match=rf"^{field} has \d+ characters; at most {limit} are allowed") as raised:
        check_texts(args)
    assert isinstance(raised.value, InvalidData)
    assert raised.value.code == "text_too_long"


def test_texts_within_the_limits_pass() -> None:
    check_texts(RegisterUserArgs("é" * NAME))
    check_texts([Parameter("n" * NAME, "string", "v" * VALUE)])
    check_texts(UploadPackageArgs("pkg_1", "x" * 2_000_000))


def test_only_content_has_no_limit_here() -> None:
    unlimited = {field for field, limit in LIMITS.items() if limit is None}
    assert unlimited == {"data", "image", "source", "script", "client", "values"}
