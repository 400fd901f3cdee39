"""Access rules of the viewer: which host names it answers to, from which pages, and who may edit."""

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
    """Host names that a server answers to.

    A foreign site whose name resolves to this machine (DNS rebinding) sends that name, never an address.

    Attributes
    ----------
    names : accepted host names, lower case.
    accepts_any_address : accept every numeric address too.
    """

    names: tuple[str, ...]
    accepts_any_address: bool = False

    def refusal(self, hosts: Sequence[str], origins: Sequence[str]) -> tuple[int, str] | None:
        """Return status and reason for rejecting a request, None to accept it.

        Clients other than browsers send no origin. Browsers always do where a page of another site opens a socket.

        Parameters
        ----------
        hosts : values of the Host header.
        origins : values of the Origin header.
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
        return name in self.names or (self.accepts_any_address and _is_address(name))


def editor_request_refusal(
    token: str, tokens: Sequence[str], origins: Sequence[str], *, writes: bool
) -> tuple[int, str] | None:
    """Return status and reason for rejecting an editor's request; None to accept it.

    Applies to requests that `HostGuard.refusal` accepts.

    Parameters
    ----------
    token : the editor's token.
    tokens : values of the token header. Not a cookie: browsers send cookies to every port of this machine.
    origins : values of the Origin header.
    writes : the request writes, so it must state its origin, as browsers do.
    """
    if len(tokens) != 1 or not hmac.compare_digest(tokens[0].encode(), token.encode()):
        return 403, "the token is missing or of an earlier viewer; open the address that the terminal shows"
    if writes and len(origins) != 1:
        return 403, "what is written must come from the viewer's own page"
    return None


def create_guard(host: str, bound: str) -> HostGuard:
    """Create the guard of a server for the named `host` that listens on the address `bound`."""
    anywhere = ip_address(bound).is_unspecified
    own = (socket.gethostname(),) if anywhere else ()
    return HostGuard(tuple(dict.fromkeys(name.lower() for name in (host, bound, *LOOPBACK_NAMES, *own))), anywhere)


def parse_host_name(host: str) -> str:
    """Return the name in a Host header in lower case, without port and brackets; empty where invalid."""
    found = re.fullmatch(r"(?:\[([0-9a-f:.]+)\]|([\w.-]+))(?::\d+)?", host.lower(), re.ASCII)
    return (found[1] or found[2]) if found else ""


def bracket_ipv6(name: str) -> str:
    """Return a host name as written in a web address."""
    return f"[{name}]" if ":" in name else name


def _is_address(name: str) -> bool:
    try:
        ip_address(name)
    except ValueError:
        return False
    return True
