"""Which role may say what: all of the authorisation, as two tables.

It is decided before a message reaches the hub's state machine. Whoever comes in by the local door
has every role.
"""

from denseface.service.protocol.messages import Message
from denseface.service.protocol.topics import Topic
from denseface.service.security.allow_list import Role

__all__ = ["ALL_ROLES", "ROLES_BY_KIND", "ROLES_BY_TOPIC", "missing_role"]

ALL_ROLES = frozenset(Role)
_S, _W = frozenset({Role.SENSOR}), frozenset({Role.WORKER})
_OPERATOR = frozenset({Role.OPERATOR})

ROLES_BY_KIND: dict[str, frozenset[Role]] = {
    "press": frozenset({Role.PRESSER}),
    # Also a presser, for what it pressed itself.
    "get_face": frozenset({Role.SUBSCRIBER}),
    "get_next": frozenset({Role.SUBSCRIBER}),
    "find_start": frozenset({Role.SUBSCRIBER}),
    "get_status": ALL_ROLES,
    "list_dead": _OPERATOR,
    "retry_dead": _OPERATOR,
    "drop_dead": _OPERATOR,
    "purge": _OPERATOR,
    "sensor_ready": _S,
    "frame": _S,
    "frame_failed": _S,
    "preview_frame": _S,
    "worker_ready": _W,
    "result": _W,
    "job_failed": _W,
    "heartbeat": _S | _W,
    "goodbye": _S | _W,
}
"""Kind of message -> roles of which one is needed. A kind that is not here is for nobody."""

ROLES_BY_TOPIC: dict[Topic, frozenset[Role]] = dict.fromkeys(Topic, frozenset({Role.SUBSCRIBER}))
"""Topic -> roles of which one is needed."""


def missing_role(roles: frozenset[Role], message: Message, *, own: bool = False) -> str | None:
    """Say what a key lacks to say this, None where it may.

    Parameters
    ----------
    own : the message asks for a capture that this key pressed
    """
    needed = ROLES_BY_KIND.get(message.kind, frozenset())
    if roles & needed or (own and message.kind == "get_face" and Role.PRESSER in roles):
        return None
    return f"{message.kind} needs the role {' or '.join(sorted(needed)) or 'of nobody'}"
