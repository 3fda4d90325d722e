"""Damaged inputs: good ones cut, spliced, doubled, and sprinkled with the numbers that break readers."""

from hypothesis import strategies as st

_NUMBERS = [
    b"\0",
    b"\xff",
    b"\x7f",
    b"\x80",
    b"\0\0\0\0",
    b"\xff\xff\xff\xff",
    b"\x7f\xff\xff\xff",
    b"\xff\xff\xff\x7f",
    b"\x80\0\0\0",
    b"\0\0\xc0\x7f",
    b"\x7f\xc0\0\0",
    b"NaN",
    b"1e999",
    b"[" * 200,
    b"\x91" * 200,
    b"#bundle\0\0\0\0\0\0\0\0\1",
    b'"',
    b"/*",
]


@st.composite
def damaged(draw, good: list[bytes]):
    """A good input with up to six things done to it, or any bytes at all."""
    if draw(st.integers(0, 19)) == 0:
        return draw(st.binary(max_size=600))
    data = draw(st.sampled_from(good))
    for _ in range(draw(st.integers(1, 6))):
        at = draw(st.integers(0, len(data)))
        match draw(st.integers(0, 6)):
            case 0:
                data = data[:at]
            case 1:
                data = data[at:]
            case 2:
                patch = draw(st.sampled_from(_NUMBERS))
                data = data[:at] + patch + data[at + len(patch) :]
            case 3:
                data = data[:at] + draw(st.sampled_from(_NUMBERS)) + data[at:]
            case 4:
                data = data[:at] + draw(st.binary(min_size=1, max_size=4)) + data[at + 1 :]
            case 5:
                other = draw(st.sampled_from(good))
                data = data[:at] + other[draw(st.integers(0, len(other))) :]
            case 6:
                data = (data * draw(st.integers(2, 50)))[:70_000]
    return data
