"""The web server, on this machine alone unless asked otherwise."""

from __future__ import annotations

import contextlib
import importlib.util
import io
import ipaddress
import logging
import socket
from typing import TYPE_CHECKING

from brachis.errors import InputError, NotInstalledError

if TYPE_CHECKING:
    import viser

LOOPBACK = "127.0.0.1"
FIRST_PORT = 8080
"""The port that is tried first if the user gives none."""


def start_server(host: str, port: int | None) -> viser.ViserServer:
    """Start a server.

    Parameters
    ----------
    host : str
        Address or name that it listens on.
    port : int or None
        0 takes any free port, None the first free one from `FIRST_PORT` on.

    Raises
    ------
    InputError
        The host is not on this machine, or the port is out of range or is in use.
    NotInstalledError
        viser is not installed.
    """
    require_viser()
    import viser

    class Server(viser.ViserServer):  # type: ignore[misc]  # not read by mypy
        """A silent server whose scene stays on this machine: with viser's own, a page can have it published."""

        def request_share_url(self, verbose: bool = True) -> None:  # noqa: FBT002  (viser's signature)
            """Refuse to give the scene a public address."""

        def stop(self) -> None:
            """Stop without a word: standard output is for results."""
            with contextlib.redirect_stdout(io.StringIO()):
                super().stop()

    _check(host, port or 0)
    # Probes, such as HEAD, are refused without a word.
    logging.getLogger("websockets.server").setLevel(logging.CRITICAL)
    first = FIRST_PORT if port is None else port  # viser takes the next free one
    with contextlib.redirect_stdout(io.StringIO()):
        return Server(host=host, port=first, label="brachis", verbose=False)


def require_viser() -> None:
    """Refuse to go on without viser.

    Raises
    ------
    NotInstalledError
    """
    if importlib.util.find_spec("viser") is None:
        raise NotInstalledError("the viewer", "viser", "view")


def is_local(host: str) -> bool:
    """Tell whether an address that was listened on is reached from this machine alone."""
    addresses = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)
    return all(ipaddress.ip_address(address[4][0]).is_loopback for address in addresses)


def _check(host: str, port: int) -> None:
    """Refuse an address that cannot be listened on."""
    if not 0 <= port <= 65535:
        raise InputError(
            "the port is out of range", where="--port", found=port, allowed="0 to 65535"
        )
    try:
        address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        socket.create_server(address[4], family=address[0]).close()
    except (OSError, UnicodeError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(
            "the viewer cannot listen on this address",
            where="--host, --port",
            found=f"{host}, port {port}: {reason}",
            allowed=f"an address of this machine, for example {LOOPBACK}, or 0.0.0.0 for all of them; a free port",
            hint="Leave out --port to use the next free port",
        ) from error
