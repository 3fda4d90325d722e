"""Who sees the hands of avatars: the clients that have subscribed to them, and the page if it shows them."""

from manipnet.outputs.publisher import Publisher
from manipnet.page.supervisor import LivePage
from manipnet.synthesis.hand.profile import HandProfile
from manipnet.wire import HandsMessage


class PageAndClients:
    """An `AvatarAudience`. Belongs to the tick thread."""

    def __init__(self, publisher: Publisher, page: LivePage) -> None:
        self._publisher, self._page = publisher, page

    def wants(self, avatar: str) -> bool:
        """Whether a client or the page wants the hands of an avatar."""
        return self._publisher.wants(avatar) or self._page.wants(avatar)

    def publish_avatar(self, message: HandsMessage, profile: HandProfile) -> None:
        """Send the hands of an avatar to whoever wants them."""
        if self._page.wants(profile.name):
            self._page.see_avatar(message)
        if self._publisher.wants(profile.name):
            self._publisher.publish_avatar(message, profile)
