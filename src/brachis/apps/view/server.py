"""The viewer's web server. By default, only this machine can reach it."""

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
"""Port that is tried first if the user gives no port."""


def start_server(host: str, port: int | None) -> viser.ViserServer:
    """Start the viewer's server.

    Parameters
    ----------
    host : str
        Address or name of the host on which the server listens.
    port : int or None
        Port of the server. 0 chooses any free port; None chooses the first free port from `FIRST_PORT` on.

    Raises
    ------
    InputError
        The host is not on this machine, or the port is out of range or in use.
    NotInstalledError
        viser is not installed.
    """
    require_viser()
    import viser

    class Server(viser.ViserServer):  # type: ignore[misc]  # not read by mypy
        """A silent server whose scene stays on this machine. With viser's own server, a page can publish the scene."""

        def request_share_url(self, verbose: bool = True) -> None:  # noqa: FBT002  (viser's signature)
            """Do nothing, so that the scene does not get a public address."""

        def stop(self) -> None:
            """Stop the server silently, because standard output is for results."""
            with contextlib.redirect_stdout(io.StringIO()):
                super().stop()

    _check(host, port or 0)
    # Reject probes, such as HEAD requests, without a message.
    logging.getLogger("websockets.server").setLevel(logging.CRITICAL)
    first = FIRST_PORT if port is None else port  # viser chooses the next free port
    with contextlib.redirect_stdout(io.StringIO()):
        return Server(host=host, port=first, label="brachis", verbose=False)


def require_viser() -> None:
    """Raise an error if viser is not installed.

    Raises
    ------
    NotInstalledError
    """
    if importlib.util.find_spec("viser") is None:
        raise NotInstalledError("the viewer", "viser", "view")


def is_local(host: str) -> bool:
    """Return whether only this machine can reach an address on which the server listens."""
    addresses = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)
    return all(ipaddress.ip_address(address[4][0]).is_loopback for address in addresses)


def _check(host: str, port: int) -> None:
    """Raise an error for an address on which the server cannot listen."""
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
            allowed=f"an address of this machine, such as {LOOPBACK}, or 0.0.0.0 for all its addresses; a free port",
            hint="Leave out --port to use the next free port",
        ) from error
