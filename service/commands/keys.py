"""`denseface keys`."""

import argparse
import os
from contextlib import suppress

from denseface.service.commands import _options
from denseface.service.runtime.terminal import say, suggest

_ROLES = ("sensor", "worker", "presser", "subscriber", "operator")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    actions = parser.add_subparsers(dest="action", metavar="new|allow|revoke|list", required=True)
    new = actions.add_parser("new", help="make a pair: NAME.secret and NAME.public", description=(
        "Make a pair of keys. `hub` is the name of the hub's own."))
    new.add_argument("name", metavar="NAME",
                     help="letters, digits, - and _, at most 64; also of its files")
    allow = actions.add_parser("allow", help="let a public key in", description=(
        "Let a public key in, with one or more roles. A hub that runs takes note at once."))
    allow.add_argument("name", metavar="NAME", help="what the key is to be called here")
    allow.add_argument("public", metavar="KEY", help="its file NAME.public, or its 40 characters")
    allow.add_argument("roles", metavar="ROLE", nargs="+", choices=_ROLES,
                       help=", ".join(_ROLES))
    revoke = actions.add_parser("revoke", help="let a key in no more", description=(
        "Let a key in no more. A hub that runs cuts off at once whoever uses it."))
    revoke.add_argument("name", metavar="NAME", help="as `denseface keys list` shows it")
    listed = actions.add_parser("list", help="say which keys may connect")
    for action in (new, allow, revoke, listed):
        _options.add_keys(action)


def run(args: argparse.Namespace) -> int:
    from denseface.service import security
    from denseface.service.protocol.roles import Role
    from denseface.service.settings import ServiceSettings

    folder = ServiceSettings.of(os.environ, keys=args.keys).keys
    match args.action:
        case "new":
            secret, public = security.new_pair(folder, args.name)
            say(f"{secret}  stays where it is used",
                f"{public}  goes to the other side: {security.read_public(public)}")
            if args.name != "hub":
                suggest(f"denseface keys allow {args.name} {public.name} ROLE",
                        f"on the hub's machine, which {public.name} was brought to")
        case "allow":
            one = security.allow(folder, args.name, security.read_public(args.public),
                                 frozenset(map(Role, args.roles)))
            say(f"{one.name} ({one.fingerprint}) may connect as {', '.join(sorted(one.roles))}")
        case "revoke":
            security.revoke(folder, args.name)
            say(f"{args.name} may connect no more")
        case "list":
            with suppress(FileNotFoundError):
                next((folder / "allowed").iterdir(), None)  # what cannot be read is no empty list
            for one in sorted(security.AllowList(folder), key=lambda one: one.name):
                say(f"{one.name:20} {one.fingerprint}  {', '.join(sorted(one.roles))}")
    return 0
