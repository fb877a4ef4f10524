"""Which role may say and read what: the tables of messages and of topics, and what they decide.

It is decided before a message reaches the hub's state machine. Whoever comes in by the local door
has every role.
"""

from denseface.service.protocol.message_base import BaseMessage
from denseface.service.protocol.messages import TO_HUB
from denseface.service.protocol.roles import Role
from denseface.service.protocol.topics import Topic

__all__ = ["ALL_ROLES", "ROLES_BY_KIND", "ROLES_BY_TOPIC", "missing_role"]

ALL_ROLES = frozenset(Role)

ROLES_BY_KIND: dict[str, frozenset[Role]] = {
    kind.model_fields["kind"].default: roles for kind, roles in TO_HUB.items()}
"""Kind of message -> roles of which one is needed. A kind that is not here is for nobody."""

ROLES_BY_TOPIC: dict[Topic, frozenset[Role]] = dict.fromkeys(Topic, frozenset({Role.SUBSCRIBER}))
"""Topic -> roles of which one is needed."""


def missing_role(roles: frozenset[Role], message: BaseMessage, *, own: bool = False) -> str | None:
    """Say what a key lacks to say this, None where it may.

    Parameters
    ----------
    own : the message asks for a capture that this key pressed
    """
    needed = ROLES_BY_KIND.get(message.kind, frozenset())
    if roles & needed or (own and message.kind == "get_face" and Role.PRESSER in roles):
        return None
    return f"{message.kind} needs the role {' or '.join(sorted(needed)) or 'of nobody'}"
