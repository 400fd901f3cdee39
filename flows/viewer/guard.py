"""Who may ask the viewer: requests to a name that it is served under, from no page but its own; and who may edit."""

from __future__ import annotations

import hmac
import re
import socket
from collections.abc import Sequence
from dataclasses import dataclass
from ipaddress import ip_address

LOOPBACK_NAMES = ("127.0.0.1", "localhost", "::1")


@dataclass(frozen=True)
class HostGuard:
    """The names that a server answers to. With `anywhere`, any address in digits is one too.

    A foreign site that has its own name point at this machine (DNS rebinding) asks under that name, never under an address.
    """

    names: tuple[str, ...]
    anywhere: bool = False

    def refusal(self, hosts: Sequence[str], origins: Sequence[str]) -> tuple[int, str] | None:
        """Status and reason with which a request with these Host and Origin headers is refused; None where it is not.

        Who is no browser states no origin; a browser always does where a page of another site opens a socket.
        """
        if len(hosts) != 1 or not self._known(parse_host_name(hosts[0])):
            return (
                400,
                "the viewer is not served under that name; `streetloom view --host NAME` serves it under another",
            )
        if any(origin.lower() != f"http://{hosts[0].lower()}" for origin in origins):
            return 403, "a page of another site may not ask the viewer"
        return None

    def _known(self, name: str) -> bool:
        return name in self.names or (self.anywhere and _is_address(name))


def edit_refusal(
    token: str, tokens: Sequence[str], origins: Sequence[str], *, writes: bool
) -> tuple[int, str] | None:
    """As `Guard.refusal`, of a request which that lets pass, to what only who holds the token may ask.

    tokens: its headers of that. No cookie: those are told to every server of this machine, whatever its port. What writes
    must state its origin, as browsers do.
    """
    if len(tokens) != 1 or not hmac.compare_digest(tokens[0].encode(), token.encode()):
        return 403, "the token is missing or of an earlier viewer; open the address that the terminal shows"
    if writes and len(origins) != 1:
        return 403, "what is written must come from the viewer's own page"
    return None


def create_guard(host: str, bound: str) -> HostGuard:
    """For a server that was told to listen on `host` and does so on the address `bound`."""
    anywhere = ip_address(bound).is_unspecified
    own = (socket.gethostname(),) if anywhere else ()
    return HostGuard(tuple(dict.fromkeys(name.lower() for name in (host, bound, *LOOPBACK_NAMES, *own))), anywhere)


def parse_host_name(host: str) -> str:
    """The name in a Host header, in lower case, without port and brackets; empty where it is none."""
    found = re.fullmatch(r"(?:\[([0-9a-f:.]+)\]|([\w.-]+))(?::\d+)?", host.lower(), re.ASCII)
    return (found[1] or found[2]) if found else ""


def bracket_ipv6(name: str) -> str:
    """A name as it stands in a web address."""
    return f"[{name}]" if ":" in name else name


def _is_address(name: str) -> bool:
    try:
        ip_address(name)
    except ValueError:
        return False
    return True
