"""Messages whose form is remembered say the same as messages that are read for the first time."""

import math

import pytest
from osc_writer import osc

from manipnet.inputs.osc.addresses import MOST_CACHED, MOST_STARTS, AddressBook
from manipnet.inputs.osc.declared import read_pattern
from manipnet.inputs.osc.patterns import PATTERNS
from manipnet.wire.bodies import MessageError

KEYS = {"body": "Box", "skeleton": "Ann", "bone": 7, "name": "LHand"}
DECLARED = tuple(
    read_pattern({"address": address, "arguments": arguments, **more})
    for address, arguments, more in [
        ("/behind", "x y z body", {"axes": "z-up"}),
        ("/mixed/<body>", "qw - qx qy qz x y z", {}),
        ("/parts/<body>", "y x", {"axes": "z-up left", "unit": "cm"}),
        ("/turns/<body>", "rx ry rz", {"rotation_order": "xzy", "angles": "radians"}),
    ]
)
TYPES = ("f", "d", "i", "h")


def message(pattern, number, type):
    """A message by a pattern, whose numbers depend on `number` and have the OSC type `type`."""
    address = pattern.address
    for key, value in KEYS.items():
        address = address.replace(f"<{key}>", str(value))

    def argument(i, word):
        if word in KEYS:
            return KEYS[word]
        if word.startswith("="):
            return int(word[1:]) if word[1:].isdigit() else word[1:]
        return (type, number + i if type in "ih" else 0.5 * number + 0.25 * i)

    return osc(address, *[argument(i, word) for i, word in enumerate(pattern.words)])


def read(book, datagram):
    content = book.read(datagram)
    assert content is not None
    return content


def comparable(content):
    """A content without its converter, which has no equality."""
    return (content.route._replace(converter=None), *content[1:])


@pytest.mark.parametrize("type", TYPES)
@pytest.mark.parametrize("pattern", [*PATTERNS, *DECLARED], ids=lambda each: f"{each.address} {each.arguments}")
def test_the_second_message_says_what_it_says_as_the_first(pattern, type):
    book = AddressBook(DECLARED)
    for number in range(3):
        content = read(book, message(pattern, number, type))
        assert comparable(content) == comparable(read(AddressBook(DECLARED), message(pattern, number, type)))
        assert all(isinstance(value, float) for value in content.values)


def test_a_message_of_another_length_is_no_other_message():
    book = AddressBook()
    book.read(osc("/rigidbody/1/position", 1.0, 2.0, 3.0))
    good = osc("/rigidbody/1/position", 4.0, 5.0, 6.0)
    for wrong in (good[:-4], good + bytes(4)):
        with pytest.raises(MessageError):
            book.read(wrong)


def test_an_impossible_time_is_refused_each_time():
    book = AddressBook()
    for stamp in (1.0, math.nan, math.inf, 2.0):
        if math.isfinite(stamp):
            assert read(book, osc("/frame/timestamp", stamp)).values == (stamp,)
        else:
            with pytest.raises(MessageError, match="finite"):
                book.read(osc("/frame/timestamp", stamp))


def test_another_type_is_another_form():
    book = AddressBook()
    assert read(book, osc("/rigidbody/1/tracked", 1)).values == (1.0,)
    assert read(book, osc("/rigidbody/1/tracked", False)).values == (0.0,)
    assert read(book, osc("/rigidbody/1/tracked", 0.0)).values == (0.0,)
    assert read(book, osc("/rigidbody/1/tracked", 0)).values == (0.0,)


def test_bones_get_the_name_of_their_skeleton_when_it_becomes_known():
    book, bone = AddressBook(), osc("/skeleton/bone", 9, 1, "position", 1.0, 2.0, 3.0)
    assert [read(book, bone).route.body for _ in range(2)] == ["9:1", "9:1"]
    book.name_skeleton(9, "Ann")
    assert [read(book, bone).route.body for _ in range(2)] == ["Ann:1", "Ann:1"]


def test_memory_is_bounded_when_names_never_repeat():
    book = AddressBook()
    for i in range(3 * MOST_CACHED):
        read(book, osc("/VMC/Ext/Tra/Pos", "x" * (i % 90 + 1) + str(i), *map(float, range(7))))
    assert len(book._forms) <= MOST_CACHED
    assert len(book._starts[b"/VMC/Ext/Tra/Pos"]) <= MOST_STARTS
