"""Fields of the page that show what the server reports, while a visitor changes them."""

import viser

from manipnet.page.controls import Fields


def test_a_report_is_not_written_over_what_a_visitor_has_just_changed() -> None:
    server = viser.ViserServer("127.0.0.1", 0, verbose=False)
    try:
        size, place = (server.gui.add_number(label, 1.0) for label in ("Size", "Place"))
        fields = Fields(size, place)
        assert fields.settled
        fields.write(size, 2.0)
        assert size.value == 2.0
        assert fields.settled  # this program's own changes are not a visitor's
        place.value = 5.0
        assert not fields.settled
        fields.write(place, 1.0)
        assert fields.settled
    finally:
        server.stop()
