"""Messages: a template and values become a text, and a key and values for its translation."""

import pickle

import pytest

from arcor2_hw.data.device import Connection
from arcor2_hw.data.events import ObjectStateData
from arcor2_hw.exceptions import Arcor2Error, DeviceFault, DeviceTimeout, InvalidData, SafetyStop
from arcor2_hw.messages import Message
from arcor2_server.build.reading.errors import NotUnderstood
from arcor2_server.errors import RequestRefused


def test_the_text_is_formatted_and_the_key_has_plain_fields() -> None:
    message = Message.of("Robot {robot!r} did not answer within {limit:.1f} s.", robot="ur5e", limit=2)
    assert message.text == str(message) == "Robot 'ur5e' did not answer within 2.0 s."
    assert message.key == "Robot {robot} did not answer within {limit} s."
    assert message.values == {"robot": "'ur5e'", "limit": "2.0"}


def test_without_values_braces_have_no_meaning() -> None:
    assert Message.of("Expected {x}, not {") == Message("Expected {x}, not {", "Expected {x}, not {")


def test_doubled_braces_of_a_template_stay_doubled_in_the_key() -> None:
    message = Message.of("{name} is not {{x}}.", name="a")
    assert (message.text, message.key) == ("a is not {x}.", "{name} is not {{x}}.")


def test_braces_in_values_have_no_meaning() -> None:
    message = Message.of("{name}: {reason}", name="{a}", reason=ValueError("{b"))
    assert (message.text, message.values) == ("{a}: {b", {"name": "{a}", "reason": "{b"})


def test_an_error_or_message_as_value_stays_translatable() -> None:
    inner = InvalidData("{name} is unknown.", name="x")
    message = Message.of("{device}: {reason}", device="ict1", reason=inner)
    assert message == Message("ict1: x is unknown.", "{device}: {reason}", {"device": "ict1", "reason": inner.message})
    assert Message.of("{reason!r}", reason=inner).values == {"reason": repr(inner)}


def test_translation_contains_the_fields_sent_with_the_text() -> None:
    message = Message.of("{name} is unknown.", name="x")
    assert message.translation() == {"key": "{name} is unknown.", "values": {"name": "x"}}
    assert Message.of("It is unknown.").translation() == {}


def test_joined_messages_stay_translatable_one_by_one() -> None:
    first, second = Message.of("{name} is unknown.", name="x"), Message.of("It is {state}.", state="off")
    joined = Message.joined([first, second])
    assert (joined.text, joined.key) == ("x is unknown. It is off.", "{part1} {part2}")
    assert joined.values == {"part1": first, "part2": second}
    assert Message.joined([first]) is first


def test_data_without_its_translation_is_otherwise_equal() -> None:
    plain = ObjectStateData("obj", Connection.LOST, "Scale: off")
    translated = ObjectStateData("obj", Connection.LOST, "Scale: off", key="{device}: off", values={"device": "Scale"})
    assert translated.untranslated() == plain
    assert plain.untranslated() is plain


def test_a_missing_value_is_an_error() -> None:
    with pytest.raises(KeyError, match="limit"):
        Message.of("{robot}: {limit}", robot="ur5e")


def test_an_error_has_text_key_values_and_detail() -> None:
    error = DeviceTimeout("{device} did not answer.", "register 5", device="Scale")
    assert (str(error), error.detail) == ("Scale did not answer.", "register 5")
    assert error.message == Message("Scale did not answer.", "{device} did not answer.", {"device": "Scale"})


def test_arguments_of_a_subclass_are_not_values_of_the_message() -> None:
    fault = DeviceFault("Fault {number}.", fault_code=7, number=7)
    assert (str(fault), fault.fault_code) == ("Fault 7.", 7)
    stop = SafetyStop("{robot} stopped.", kind="emergency_stop", robot="ur5e")
    assert (str(stop), stop.kind) == ("ur5e stopped.", "emergency_stop")
    refused = RequestRefused("{user} left.", data=[1], user="Eva")
    assert (str(refused), refused.data) == ("Eva left.", [1])


def test_an_error_takes_over_the_message_of_another() -> None:
    first = InvalidData("{name} is unknown.", name="x")
    assert Arcor2Error(first.message, first.detail).message is first.message


def test_without_a_message_the_class_provides_it() -> None:
    assert str(DeviceTimeout()) == "The device did not answer, or did not finish, within the time limit."


def test_pickling_preserves_the_message() -> None:
    error = pickle.loads(pickle.dumps(DeviceFault("{device}: fault", "d", 3, device="Scale")))
    assert error.message == Message("Scale: fault", "{device}: fault", {"device": "Scale"})
    assert (str(error), error.detail, error.fault_code) == ("Scale: fault", "d", 3)


@pytest.mark.parametrize("values", [{}, {"name": "a"}])
def test_a_script_error_prepends_the_line(values: dict[str, str]) -> None:
    error = NotUnderstood(3, "{name} is unknown." if values else "{} is unknown.", **values)
    assert str(error) == f"script.py, line 3: {'a' if values else '{}'} is unknown."
    assert error.message.key == "script.py, line {line}: {problem}"
    assert error.message.values["problem"] == Message.of("{name} is unknown." if values else "{} is unknown.", **values)
