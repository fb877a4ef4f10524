"""What a key is for."""

from enum import StrEnum


class Role(StrEnum):
    """What a key is for; what each may say is in `service.protocol.messages.TO_HUB`."""

    SENSOR = "sensor"
    WORKER = "worker"
    PRESSER = "presser"
    SUBSCRIBER = "subscriber"
    OPERATOR = "operator"
