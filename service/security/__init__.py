"""Keys, the allow-list, and which role may do what.

`permissions` and `zap` are imported by module: a command that only writes keys needs no messages.
"""

from denseface.service.security._allow_list import AllowedKey, AllowList, allow, revoke
from denseface.service.security._keys import (
    HUB_NAME,
    KeyPair,
    fingerprint,
    new_pair,
    read_pair,
    read_public,
)

__all__ = ["HUB_NAME", "AllowList", "AllowedKey", "KeyPair", "allow", "fingerprint",
           "new_pair", "read_pair", "read_public", "revoke"]
