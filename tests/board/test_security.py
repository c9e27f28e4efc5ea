"""Strangers, foreign pages and wrong addresses get nothing from the board, and change nothing."""

from __future__ import annotations

import re
import socket
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

import httpx
import pytest

from pbrs_farm.board.guard import Buckets
from pbrs_farm.board.options import BoardLimits, is_loopback
from pbrs_farm.board.sessions import Sessions
from pbrs_farm.store.secret import Secret
from tests.board.roots import write_root, write_view
from tests.board.served import TOKEN, log_in, served

VIEW = "/homes/a-1/views/0_0_1"


def test_another_name_for_the_board_is_refused(client: httpx.Client) -> None:
    assert client.get("/", headers={"Host": "evil.example"}).status_code == 400
    assert client.get("/", headers={"Host": "evil.example:8080"}).status_code == 400
    assert client.get("/", headers={"Host": "a@127.0.0.1.evil.example"}).status_code == 400
    assert client.get("/", headers={"Host": "localhost"}).status_code == 200


def test_a_name_that_the_operator_allows_is_the_boards(root: Path, tmp_path: Path) -> None:
    with served(str(root), tmp_path, allowed_hosts=("board.example",)) as client:
        assert client.get("/", headers={"Host": "board.example"}).status_code == 200


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "::1", "127.8.8.8"])
def test_loopback_is_this_machine(host: str) -> None:
    assert is_loopback(host)


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "10.0.0.1", "example.org"])
def test_everything_else_is_not(host: str) -> None:
    assert not is_loopback(host)


def test_beyond_loopback_nothing_is_read_without_the_token(root: Path, tmp_path: Path) -> None:
    with served(str(root), tmp_path, host="0.0.0.0") as client:
        for path in ("/", "/views", VIEW, f"{VIEW}/file/depth", f"{VIEW}/pixels"):
            answer = client.get(path)
            assert (answer.status_code, answer.headers["location"]) == (303, "/login")
        # The form's static files are readable.
        assert client.get("/login").status_code == 200
        assert client.get("/static/board.css").status_code == 200
        assert log_in(client, "a guess").status_code == 403
        assert client.get("/").status_code == 303
        assert log_in(client).status_code == 303
        assert "Home a-1" in client.get("/").text


def test_a_script_shows_the_token_itself(root: Path, tmp_path: Path) -> None:
    with served(str(root), tmp_path, host="0.0.0.0") as client:
        wrong = client.get("/views", headers={"Authorization": "Bearer guess"})
        right = client.get("/views", headers={"Authorization": f"Bearer {TOKEN}"})
        assert (wrong.status_code, right.status_code) == (303, 200)


def test_the_sessions_cookie_is_no_scripts_and_no_other_sites(root: Path, tmp_path: Path) -> None:
    with served(str(root), tmp_path) as client:
        cookie = log_in(client).headers["set-cookie"].lower()
        assert "httponly" in cookie
        assert "samesite=strict" in cookie
        assert TOKEN not in cookie


def form_word(client: httpx.Client) -> str:
    match = re.search(r'name="form_word" value="([0-9a-f]{64})"', client.get("/").text)
    assert match
    return match[1]


def test_a_change_needs_a_session_and_its_form_word(root: Path, tmp_path: Path) -> None:
    with served(str(root), tmp_path) as client:
        assert client.post("/logout").status_code == 401
        log_in(client)
        assert client.post("/logout").status_code == 403
        assert client.post("/logout", data={"form_word": "0" * 64}).status_code == 403
        word = form_word(client)
        assert client.post("/logout", data={"form_word": word}).status_code == 303
        # The session has ended: its token is invalid now.
        assert client.post("/logout", data={"form_word": word}).status_code == 401


def test_a_form_of_another_session_does_not_count(root: Path, tmp_path: Path) -> None:
    with served(str(root), tmp_path) as client:
        log_in(client)
        word = form_word(client)
        client.cookies.clear()
        log_in(client)
        assert client.post("/logout", data={"form_word": word}).status_code == 403


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Sec-Fetch-Site": "cross-site"},
        {"Sec-Fetch-Site": "same-site"},
    ],
)
def test_a_change_from_a_foreign_page_is_refused(
    headers: dict[str, str], root: Path, tmp_path: Path
) -> None:
    with served(str(root), tmp_path) as client:
        log_in(client)
        data = {"form_word": form_word(client)}
        assert client.post("/logout", data=data, headers=headers).status_code == 403
        origin = {"Origin": str(client.base_url).rstrip("/")}
        assert client.post("/logout", data=data, headers=origin).status_code == 303


def test_nothing_changes_on_a_readonly_board(root: Path, tmp_path: Path) -> None:
    with served(str(root), tmp_path, is_readonly=True) as client:
        log_in(client)
        answer = client.post("/logout", data={"form_word": form_word(client)})
        assert (answer.status_code, "--readonly" in answer.text) == (403, True)


def test_every_answer_forbids_inline_scripts_frames_and_guessed_types(client: httpx.Client) -> None:
    for path in ("/", "/views", VIEW, "/no-such-page", "/static/view.js", f"{VIEW}/pixels"):
        headers = client.get(path).headers
        policy = headers["content-security-policy"]
        assert "default-src 'none'" in policy
        assert "script-src 'self';" in policy
        assert "style-src 'self';" in policy
        assert "unsafe" not in policy
        assert "frame-ancestors 'none'" in policy
        assert headers["x-content-type-options"] == "nosniff"
        assert "server" not in headers
    refused = client.get("/", headers={"Host": "evil.example"})
    assert "content-security-policy" in refused.headers


@pytest.mark.parametrize("path", ["/", "/views", VIEW, "/login"])
def test_pages_contain_no_inline_script_or_style(path: str, client: httpx.Client) -> None:
    html = client.get(path).text
    assert not re.search(r"<script(?![^>]*\bsrc=)", html)
    assert not re.search(r"<style|\sstyle=|\son\w+=|javascript:", html)
    assert not re.search(r'(?:src|href)="(?:https?:)?//', html)


@pytest.mark.parametrize(
    "path",
    [
        "/homes/..%2f..%2fetc/views/passwd",
        "/homes/a-1/views/..%2f..%2f..%2frecipe.json",
        "/homes/a-1/views/0_0_1/file/..%2fview.json",
        "/homes/a-1/views/0_0_1/file/../../../../../recipe.json",
        "/homes/a-1/views/0_0_1/file/%2e%2e%2f%2e%2e%2fhouse.json",
        "/homes/a-1/views/0_0_1/shown/%2fetc%2fpasswd.png",
        "/homes/%00/views/0_0_1",
        "/static/..%2foptions.py",
        "/static/../options.py",
        "/static/%2fetc%2fpasswd",
    ],
)
def test_no_address_leads_to_a_file_that_is_not_listed(path: str, client: httpx.Client) -> None:
    # A hand-written request: a client normalises "..".
    request = client.build_request("GET", "/")
    request.url = request.url.copy_with(raw_path=path.encode())
    answer = client.send(request)
    assert answer.status_code == 404
    assert "root:" not in answer.text


def test_a_link_that_leads_out_of_the_root_is_not_followed(tmp_path: Path) -> None:
    secret = tmp_path / "secret.png"
    root = write_root(tmp_path / "root", {"a-1": ("0_0_1",)})
    view = root / "houses/a-1/views/0_0_1"
    secret.write_bytes((view / "depth.png").read_bytes())
    (view / "depth.png").unlink()
    (view / "depth.png").symlink_to(secret)
    (view / "glass.png").symlink_to("/etc/passwd")
    with served(str(root), tmp_path / "cache") as client:
        for part in ("file/depth", "file/glass", "shown/depth.png", "thumb/depth.jpg"):
            assert client.get(f"{VIEW}/{part}").status_code == 404
        assert client.get(f"{VIEW}/file/semantic").status_code == 200


def test_names_of_strangers_are_text_and_nothing_else(tmp_path: Path) -> None:
    name = "<script>alert(1)</script>\"'><img src=x onerror=alert(2)>"
    rooms = [{"id": "0_0", "name": name}]
    source = {"attribution": name}
    root = write_root(tmp_path / "root", {"a-1": ()}, name=name, rooms=rooms, source=source)
    instance = {"id": 1, "name": name, "class": name, "nyu40": 5, "fraction": 0.1,
                "visible_fraction": 1, "box2d": [0, 0, 4, 4]}  # fmt: skip
    write_view(root / "houses/a-1/views/0_0_1", instances=[instance], warnings=[name], origin=name)
    with served(str(root), tmp_path / "cache") as client:
        for path in ("/", "/views", "/homes/a-1", VIEW, f"/views?words={name}", f"/?words={name}"):
            html = client.get(path).text
            assert "<script>" not in html
            assert "<img src=x" not in html
        assert "&lt;script&gt;" in client.get("/").text


def test_a_view_json_of_nonsense_is_shown_as_far_as_it_goes(tmp_path: Path) -> None:
    root = write_root(tmp_path / "root", {"a-1": ()})
    nonsense = {"instances": [1, {"id": -5, "box2d": [0, 0, 9, 9], "fraction": float("nan")},
                {"id": 2, "box2d": "wide"}], "modes": [], "warnings": "none"}  # fmt: skip
    write_view(root / "houses/a-1/views/0_0_1", **nonsense)
    (root / "houses/a-1/views/0_0_1/semantic.png").write_bytes(b"\x89PNG\r\n\x1a\nno")
    with served(str(root), tmp_path / "cache") as client:
        assert client.get(VIEW).status_code == 200
        assert client.get(f"{VIEW}/shown/semantic.png").status_code == 422
        assert client.get(f"{VIEW}/pixels").status_code == 200


def test_frequent_requests_are_delayed(root: Path, tmp_path: Path) -> None:
    limits = BoardLimits(requests_per_s=0.001, burst=5)
    with served(str(root), tmp_path, limits=limits) as client:
        codes = [client.get("/login").status_code for _ in range(7)]
        assert codes == [200] * 5 + [429] * 2
        assert client.get("/health").status_code == 200


@contextmanager
def half_open(client: httpx.Client, n: int, sent: bytes) -> Iterator[list[socket.socket]]:
    """n connections that sent some bytes and then stay silent."""
    address = (client.base_url.host, client.base_url.port or 0)
    with ExitStack() as stack:
        sockets = [stack.enter_context(socket.create_connection(address)) for _ in range(n)]
        for held_socket in sockets:
            held_socket.sendall(sent)
        yield sockets


def test_three_hundred_half_open_connections_block_nobody(root: Path, tmp_path: Path) -> None:
    with served(str(root), tmp_path) as client, half_open(client, 300, b"GET / HTTP/1.1\r\n"):
        assert [client.get(path).status_code for path in ("/", "/health", VIEW)] == [200] * 3


def test_a_connection_without_a_timely_request_is_closed(root: Path, tmp_path: Path) -> None:
    limits = BoardLimits(receive_s=0.2)
    form = b"POST /login HTTP/1.1\r\nHost: localhost\r\nContent-Length: 9\r\n\r\ntoken"
    with served(str(root), tmp_path, limits=limits) as client:
        for sent in (b"", b"GET / HTTP/1.1\r\nHost: loc"):
            with half_open(client, 1, sent) as (connection,):
                connection.settimeout(5)
                with suppress(ConnectionResetError):
                    assert connection.recv(100) == b""
        with half_open(client, 1, form) as (connection,):
            connection.settimeout(5)
            assert connection.recv(100).startswith(b"HTTP/1.1 408")


def test_a_wrong_bearer_counts_as_a_wrong_login(root: Path, tmp_path: Path) -> None:
    with served(str(root), tmp_path, host="0.0.0.0") as client:

        def status_of(token: str) -> int:
            return client.get("/views", headers={"Authorization": f"Bearer {token}"}).status_code

        assert [status_of(TOKEN) for _ in range(9)] == [200] * 9
        assert [status_of(f"guess {k}") for k in range(6)] == [303] * 5 + [429]
        assert status_of(TOKEN) == 429
        assert log_in(client).status_code == 429


def test_two_long_tokens_that_begin_alike_are_two(root: Path, tmp_path: Path) -> None:
    long = "t" * 3000
    sessions = Sessions(Secret(long))
    assert sessions.knows(long)
    assert not sessions.knows(long[:-1])
    with served(str(root), tmp_path, token=Secret(long)) as client:
        assert log_in(client, long[:200]).status_code == 403
        assert log_in(client, long).status_code == 303


def test_a_file_comes_in_pieces_and_whole(
    root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pbrs_farm.board.root_reader.PIECE_BYTES", 100)
    stored = (root / "houses/a-1/views/0_0_1/depth.png").read_bytes()
    with served(str(root), tmp_path) as client:
        answer = client.get(f"{VIEW}/file/depth")
    assert len(stored) > 100
    assert (answer.content, int(answer.headers["content-length"])) == (stored, len(stored))


def test_tokens_cannot_be_guessed_quickly(root: Path, tmp_path: Path) -> None:
    with served(str(root), tmp_path) as client:
        codes = [log_in(client, f"guess {k}").status_code for k in range(7)]
        assert codes == [403] * 5 + [429] * 2
        assert log_in(client).status_code == 429


def test_a_bucket_fills_again() -> None:
    now = [0.0]
    buckets = Buckets(per_s=1.0, burst=2.0, clock=lambda: now[0])
    assert [buckets.takes("a") for _ in range(3)] == [True, True, False]
    assert buckets.takes("b")
    now[0] = 1.0
    assert [buckets.takes("a") for _ in range(2)] == [True, False]


def test_long_addresses_and_large_forms_are_refused(client: httpx.Client) -> None:
    assert client.get(f"/views?words={'x' * 5000}").status_code == 414
    assert client.post("/login", content=b"token=" + b"x" * 20_000).status_code == 413
    assert client.put("/login").status_code == 405


def test_an_empty_token_opens_nothing() -> None:
    assert not Sessions(Secret("")).knows("")
