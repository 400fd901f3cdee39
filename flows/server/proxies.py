"""Proxies of the environment: requests to this machine never use them."""

from __future__ import annotations

import os
from collections.abc import MutableMapping

_LOOPBACK_HOSTS = ("localhost", "127.0.0.1", "::1")
# Of both spellings most libraries read the lower case first.
_EXEMPTION_VARIABLES = ("no_proxy", "NO_PROXY")


def exempt_loopback_from_proxies(environment: MutableMapping[str, str] = os.environ) -> None:
    """Add the names of this machine to NO_PROXY, so that a proxy receives no request meant for it."""
    stated = next((value for name in _EXEMPTION_VARIABLES if (value := environment.get(name))), "")
    hosts = [host.strip() for host in stated.split(",") if host.strip()]
    if "*" in hosts:
        return
    hosts += [host for host in _LOOPBACK_HOSTS if host not in hosts]
    environment.update(dict.fromkeys(_EXEMPTION_VARIABLES, ",".join(hosts)))


def find_proxy_defect() -> str | None:
    """Return the reason why the environment's proxies break Prefect's client, which reads all of them; None without."""
    import httpx

    try:
        httpx.Client().close()
    except (ImportError, ValueError, httpx.InvalidURL) as error:  # SOCKS without its package, or no address
        return f"a proxy in the environment (HTTP_PROXY, HTTPS_PROXY, ALL_PROXY) cannot be used: {error}"
    return None
