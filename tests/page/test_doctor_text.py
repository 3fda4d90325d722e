"""The doctor's findings on the page: the worst first, with their remedies, and nothing of others is read as markup."""

from manipnet.page.doctor_text import LONGEST, MOST, doctor_text


def finding(level: str, text: str, remedy: str = "") -> dict[str, str]:
    return {"level": level, "text": text, "remedy": remedy}


def test_what_is_in_order_needs_no_lines() -> None:
    assert doctor_text([]) == "● What arrives is in order"
    assert doctor_text([finding("ok", "zmq: 120 frames")]) == "● What arrives is in order"


def test_problems_come_first_with_their_remedies() -> None:
    text = doctor_text([finding("note", "a note"), finding("ok", "fine"), finding("problem", "a fault", "do this")])
    assert text == "**Doctor**\n\n⚠ a fault → *do this*\n\n○ a note"


def test_names_are_shown_as_text() -> None:
    text = doctor_text([finding("problem", "no body '<img src=x>' | [a](b)\n# arrives", "call it `*x*`")])
    for character in "<>[]|`#":
        assert character not in text.replace("&#", "")
    assert text.count("*") == len("**Doctor**".replace("Doctor", "")) + 2
    assert len(text.splitlines()) == 3


def test_many_and_long_findings_are_cut() -> None:
    text = doctor_text([finding("problem", f"{n} " + "x" * 5000) for n in range(MOST + 3)])
    assert text.endswith("and 3 more: run `manipnet doctor`")
    assert len(text) < (MOST + 1) * (LONGEST + 10)
