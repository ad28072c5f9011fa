"""Start of a web server on this computer, in a thread."""

from __future__ import annotations

import os
import socket
import threading
import time
from ipaddress import ip_address
from pathlib import Path
from typing import TYPE_CHECKING, Any

from virtual_lab.errors import InputError

if TYPE_CHECKING:
    import uvicorn
    from starlette.types import ASGIApp

LOOPBACK = "127.0.0.1"
MOST_CLIENTS = 200


def find_address(host: str, port: int, *, secure: bool) -> tuple[int, tuple[Any, ...]]:
    """Return address family and address of a host.

    Raises `InputError` if it has no address, or if it is another computer and not `secure`.
    """
    try:
        addresses = socket.getaddrinfo(host, port, proto=socket.IPPROTO_TCP)
    except (OSError, UnicodeError) as fault:
        raise InputError("", "host", host, f"has no address ({fault})") from fault
    if not (secure or all(ip_address(address[0]).is_loopback for *_, address in addresses)):
        allowed = "beyond this computer the page needs {tls_certificate} and {tls_key}"
        raise InputError("", "host", host, allowed)
    family, *_, address = addresses[0]
    return family, address


def listen(family: int, address: tuple[Any, ...]) -> socket.socket:
    """Return a socket at an address. Raises `InputError` if the port cannot be used."""
    # without the protocol an answer in two parts takes 40 ms
    listener = socket.socket(family, proto=socket.IPPROTO_TCP)
    if os.name == "posix":  # on Windows it would let another program take the port
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind(address)
    except OSError as fault:
        listener.close()
        allowed = f"cannot be served at {address[0]} ({fault.strerror}); try another"
        raise InputError("", "port", address[1], allowed) from fault
    return listener


def server_of(application: ASGIApp, tls: tuple[Path, Path] | None = None) -> uvicorn.Server:
    """Return the server of an application. `tls` are the files of certificate and key, in PEM.

    Raises `InputError` if they cannot be used.
    """
    import uvicorn

    certificate, key = tls or (None, None)
    settings = uvicorn.Config(
        application,
        log_level="warning",
        access_log=False,
        server_header=False,
        ws="none",
        lifespan="off",
        backlog=64,
        limit_concurrency=MOST_CLIENTS,
        ssl_certfile=certificate,
        ssl_keyfile=key,
    )
    try:
        settings.load()
    except OSError as fault:  # includes SSLError
        raise InputError(str(certificate), "tls", None, f"cannot be used ({fault})") from fault
    return uvicorn.Server(settings)


def start(server: uvicorn.Server, listener: socket.socket) -> threading.Thread:
    """Start a server in a thread, and return the thread as soon as pages can be opened.

    It ends soon after ``server.should_exit`` is set to True.
    """
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]}, daemon=True)
    thread.start()
    while not server.started:
        time.sleep(0.005)
    return thread
