"""The application: only who knows the token, on this machine, from its own page, gets anything."""

import json

import pytest

from runners.play.message_handler import MessageHandler

testclient = pytest.importorskip("starlette.testclient", reason="needs starlette and httpx: the extra play")

HOST = "127.0.0.1:8765"
TOKEN = "secret"


@pytest.fixture
def client(session_of, tmp_path):
    from runners.play.server import application

    return testclient.TestClient(
        application(MessageHandler(session_of(), tmp_path), TOKEN), base_url=f"http://{HOST}"
    )


def headers(host=HOST, origin=f"http://{HOST}"):
    return {"host": host, **({"origin": origin} if origin else {})}


def test_the_page_and_its_parts_are_below_the_token(client):
    page = client.get(f"/{TOKEN}/")
    assert (page.status_code, page.headers["content-type"].partition(";")[0]) == (200, "text/html")
    assert "default-src 'none'" in page.headers["content-security-policy"]
    assert page.headers["referrer-policy"] == "no-referrer"
    for name in ("play.js", "play.css"):
        assert client.get(f"/{TOKEN}/{name}").status_code == 200


@pytest.mark.parametrize(
    "path",
    ["/", "/wrong/", "/wrong/play.js", f"/{TOKEN}/../play.py", f"/{TOKEN}/%2e%2e/run.py", f"/{TOKEN}/x"],
)
def test_nothing_else_is_served(client, path):
    assert client.get(path).status_code == 404


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:8765", "", "127.0.0.1.evil.example", "192.168.0.7:8765"]
)
def test_another_name_of_this_machine_is_refused(client, host):
    assert client.get(f"/{TOKEN}/", headers={"host": host}).status_code == 421


@pytest.mark.parametrize("host", ["localhost:9000", "127.0.0.1:1", "[::1]:8765"])
def test_a_tunnel_may_have_another_port(client, host):
    assert client.get(f"/{TOKEN}/", headers={"host": host}).status_code == 200


@pytest.mark.parametrize(
    ("host", "origin"),
    [
        (HOST, "http://evil.example"),
        (HOST, None),
        (HOST, "null"),
        (HOST, "http://127.0.0.1:9999"),
        ("evil.example", "http://evil.example"),
    ],
)
def test_a_socket_from_elsewhere_is_refused(client, host, origin):
    from starlette.websockets import WebSocketDisconnect

    with (
        pytest.raises(WebSocketDisconnect),
        client.websocket_connect(f"/{TOKEN}/socket", headers=headers(host, origin)),
    ):
        pass


def test_a_socket_without_the_token_is_refused(client):
    from starlette.websockets import WebSocketDisconnect

    with pytest.raises(WebSocketDisconnect), client.websocket_connect("/wrong/socket", headers=headers()):
        pass


def heard(socket, kind):
    """The next message of a kind; others before it are passed over."""
    while True:
        message = socket.receive()
        if message.get("text") and json.loads(message["text"])["type"] == kind:
            return json.loads(message["text"])
        assert message["type"] == "websocket.send"


def test_a_page_drives_and_the_next_page_goes_on(client):
    with client.websocket_connect(f"/{TOKEN}/socket", headers=headers()) as first:
        assert heard(first, "situation")["map"] == "empty"
        first.send_text(json.dumps({"type": "advance", "until": 3, "ticket": 1}))
        heard(first, "done")
        first.send_text("nonsense")
        assert "not JSON" in heard(first, "error")["text"]
        first.send_text(json.dumps({"type": "put", "step": 2, "name": "d1", "kind": "circles",
                                    "entry": {"centre": [6, 4], "radius": 0.3}, "ticket": 2}))  # fmt: skip
        heard(first, "done")
    with client.websocket_connect(f"/{TOKEN}/socket", headers=headers()) as second:
        assert heard(second, "situation")["undoable"]


def test_a_second_page_takes_over_and_the_first_is_told(client):
    from runners.play.server import TAKEN_OVER

    with client.websocket_connect(f"/{TOKEN}/socket", headers=headers()) as first:
        heard(first, "situation")
        with client.websocket_connect(f"/{TOKEN}/socket", headers=headers()) as second:
            heard(second, "situation")
            closed = first.receive()
            while closed["type"] != "websocket.close":
                closed = first.receive()
            assert closed["code"] == TAKEN_OVER
            second.send_text(json.dumps({"type": "reset", "ticket": 5}))
            assert heard(second, "done")["ticket"] == 5
