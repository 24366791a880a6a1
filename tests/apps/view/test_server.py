import contextlib
import http.client
import importlib.util
import socket
import urllib.request

import pytest

from brachis.apps.view import require_viser
from brachis.apps.view.server import LOOPBACK, is_local, start_server
from brachis.errors import InputError, NotInstalledError

pytest.importorskip("viser", reason="viser is not installed")


@pytest.fixture
def server():
    started = start_server(LOOPBACK, 0)
    yield started
    started.stop()


def connects(address, port):
    with socket.socket() as trial:
        trial.settimeout(2.0)
        return trial.connect_ex((address, port)) == 0


def test_the_page_is_served_on_this_machine_alone(server):
    with urllib.request.urlopen(
        f"http://{LOOPBACK}:{server.get_port()}", timeout=10
    ) as answer:
        assert b"<html" in answer.read(200)
    assert not connects(
        "127.0.0.2", server.get_port()
    )  # which a server on all addresses answers, too


def test_a_probe_of_the_server_is_refused_without_a_traceback(caplog):
    server = start_server(LOOPBACK, 0)
    with contextlib.closing(
        http.client.HTTPConnection(LOOPBACK, server.get_port(), timeout=10)
    ) as connection:
        connection.request("HEAD", "/")
        with pytest.raises(http.client.RemoteDisconnected):
            connection.getresponse()
    server.stop()
    assert not caplog.records


def test_nothing_is_printed_on_standard_output(capfd):
    server = start_server(LOOPBACK, 0)
    server.stop()
    assert "viser" not in capfd.readouterr().out


def test_a_page_cannot_publish_the_scene(server):
    assert server.request_share_url() is None


def test_a_port_in_use_is_refused_and_left_out_the_next_one_is_taken(
    server, monkeypatch
):
    taken = server.get_port()
    with pytest.raises(
        InputError,
        match=rf"found 127.0.0.1, port {taken}: Address already in use.*next free port",
    ):
        start_server(LOOPBACK, taken)
    monkeypatch.setattr("brachis.apps.view.server.FIRST_PORT", taken)
    other = start_server(LOOPBACK, None)
    try:
        assert taken < other.get_port() < taken + 100
    finally:
        other.stop()


@pytest.mark.parametrize("port", [-1, 65536])
def test_what_is_no_port_is_an_error(port):
    with pytest.raises(
        InputError,
        match=rf"--port: the port is out of range; found {port}; allowed: 0 to 65535",
    ):
        start_server(LOOPBACK, port)


def test_a_host_that_is_not_here_is_an_error(monkeypatch):
    def unknown(*_args, **_kwargs):
        raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")

    with pytest.raises(
        InputError,
        match=r"--host, --port: the viewer cannot listen on this address; found 192\.0\.2\.1",
    ):  # an address of no machine
        start_server("192.0.2.1", 0)
    monkeypatch.setattr(socket, "getaddrinfo", unknown)
    with pytest.raises(
        InputError, match="found nowhere, port 0: Name or service not known"
    ):
        start_server("nowhere", 0)


def test_loopback_addresses_are_local():
    hosts = ("127.0.0.1", "::1", "192.0.2.1")
    assert [is_local(host) for host in hosts] == [True, True, False]


def test_without_viser_the_error_says_what_to_install(monkeypatch):
    find = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util,
        "find_spec",
        lambda name: None if name == "viser" else find(name),
    )
    with pytest.raises(
        NotInstalledError, match=r'needs viser, .*pip install "\.\[view\]"'
    ):
        require_viser()
