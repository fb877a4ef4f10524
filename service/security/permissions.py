"""Which role may send what and subscribe to what, by the tables of messages and topics.

They are asked before a message reaches the hub's state machine. A peer of the local listener has
every role.
"""

from denseface.service.protocol.message_base import BaseMessage
from denseface.service.protocol.messages import TO_HUB, GetFace, GetFrame
from denseface.service.protocol.roles import Role
from denseface.service.protocol.topics import Topic

__all__ = ["ALL_ROLES", "OF_ITS_OWN", "ROLES_BY_KIND", "ROLES_BY_TOPIC", "missing_role"]

ALL_ROLES = frozenset(Role)

ROLES_BY_KIND: dict[str, frozenset[Role]] = {
    kind.model_fields["kind"].default: roles for kind, roles in TO_HUB.items()}
"""Kind of message -> roles of which one is needed; nobody may send other kinds."""

ROLES_BY_TOPIC: dict[Topic, frozenset[Role]] = dict.fromkeys(Topic, frozenset({Role.SUBSCRIBER}))
"""Topic -> roles of which one is needed."""

OF_ITS_OWN = GetFace, GetFrame
"""What the role `presser` may ask for of the captures that the same key pressed."""


def missing_role(roles: frozenset[Role], message: BaseMessage, *, own: bool = False) -> str | None:
    """Say which role is missing to send a message, None where none is.

    Parameters
    ----------
    own : the message asks for a capture that this key pressed
    """
    needed = ROLES_BY_KIND.get(message.kind, frozenset())
    if roles & needed or (own and isinstance(message, OF_ITS_OWN) and Role.PRESSER in roles):
        return None
    others = isinstance(message, OF_ITS_OWN) and Role.PRESSER in roles
    return (f"{message.kind} needs the role {' or '.join(sorted(needed)) or 'of nobody'}"
            f"{', or that the same key pressed it' if others else ''}")
