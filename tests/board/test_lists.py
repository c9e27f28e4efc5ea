"""Homes and views are listed, filtered and shown as the root holds them."""

from __future__ import annotations

import asyncio
import gzip
import html
import json
import re
import shutil
import socket
import struct
from collections.abc import Iterator
from pathlib import Path

import httpx
import numpy as np
import pytest

import pbrs_farm
from pbrs_farm.board.board_state import new_board
from pbrs_farm.board.index.house_rows import HouseRow, ViewRow
from pbrs_farm.board.index.queries import Queries, filter_from_query, page_number
from pbrs_farm.board.index.refresh import Progress, Refresher
from pbrs_farm.board.index.stored_houses import StoredHouses
from pbrs_farm.board.index.view_index import ViewIndex
from pbrs_farm.board.options import BoardOptions
from pbrs_farm.board.pages.words import OF_A_CANDIDATE, OF_A_SELECTION, OF_A_VIEW
from pbrs_farm.board.root_reader import RootReader
from pbrs_farm.board.serve import application, bound_socket
from pbrs_farm.cli import main
from pbrs_farm.core import keys
from pbrs_farm.core.camera import Camera
from pbrs_farm.core.frames import opencv_world_from_camera
from pbrs_farm.core.keys import canonical_json
from pbrs_farm.core.layers import LAYERS
from pbrs_farm.curate.teaching_rules import REASONS as RULE_REASONS
from pbrs_farm.images import array_from_png, decode_photo
from pbrs_farm.sample.camera_report import Verdict
from pbrs_farm.selection.verdicts import REASONS
from pbrs_farm.store import MemoryStore, store_from_url
from pbrs_farm.store.folder import FolderStore
from pbrs_farm.store.secret import Secret
from tests.board.roots import HEIGHT, WIDTH, label_arrays, write_house, write_root, write_view
from tests.board.served import TOKEN, served

VIEW = "/homes/a-1/views/0_0_1"


def test_the_first_page_lists_homes_with_their_credit(client: httpx.Client) -> None:
    page = client.get("/").text
    assert "2 homes" in page
    assert "Home a-1" in page
    assert "3 views, 2 rooms" in page
    assert page.count("by A. Person") == 1
    assert "No home matches" in client.get("/?words=zzz").text


@pytest.mark.parametrize(
    ("query", "n"),
    [
        ("", 4),
        ("home=b-2", 1),
        ("room=Bath", 1),
        ("has=chair", 4),
        ("has=bed", 0),
        ("mode=mlt_il_ol", 4),
        ("warned=1", 0),
        ("verdict=unjudged", 4),
        ("verdict=kept", 0),
        ("words=0_0_4", 1),
        ("words=%25", 0),
        ("words=_", 4),
        ("room=Kitchen&home=a-1", 2),
        ("has=no-such-class&mode=x'--", 4),
    ],
)
def test_a_filter_in_the_address_selects_the_listed_views(
    query: str, n: int, client: httpx.Client
) -> None:
    html = client.get(f"/views?{query}").text
    assert f"<h1>{n} view" in html
    assert html.count('class="card"') == n


def test_lists_are_json_on_request(client: httpx.Client) -> None:
    homes = client.get("/?format=json&words=a-1").json()
    assert homes == {
        "page": 1,
        "n_pages": 1,
        "n_rows": 1,
        "rows": [
            {
                "house": "a-1",
                "name": "Home a-1",
                "credit": "by A. Person",
                "n_rooms": 2,
                "n_views": 3,
                "n_warned": 0,
                "best_view": "0_0_1",
            }
        ],
    }
    accept = {"Accept": "application/json"}
    views = client.get("/views?room=Bath", headers=accept).json()
    assert views["n_rows"] == 1
    (view,) = views["rows"]
    assert (view["house"], view["view"], view["verdict"]) == ("a-1", "0_1_0", "unjudged")
    assert {"mlt_il_ol", "depth", "radiance"} <= set(view["layers"])
    home = client.get("/homes/a-1", headers=accept).json()
    assert [row["view"] for row in home["views"]] == ["0_0_1", "0_0_2", "0_1_0"]
    browser = {"Accept": "text/html,application/json;q=0.9"}
    assert "<html" in client.get("/views", headers=browser).text


def test_the_contents_count_views_by_class_room_objects_light_and_verdict(tmp_path: Path) -> None:
    root = write_root(tmp_path / "root", {"a-1": ("0_0_1", "0_1_0"), "b-2": ()})
    boxes = [{"fraction": 0.5, "nyu40": k, "box3d": {"centre": [0, 0, 2 * k]}} for k in (1, 5)]
    lit = {
        "modes": {"light": {"floor_lux": {"outdoor": 40.0, "indoor": 60.0}}},
        "instances": boxes,
        "world_from_camera_opencv": np.eye(4).tolist(),
    }
    write_view(root / "houses/b-2/views/0_0_2", **lit)
    write_view(root / "houses/b-2/views/0_0_3", instances="none", modes={"light": {"floor_lux": 3}})
    (root / "houses/b-2/views/0_0_3/depth.png").unlink()
    with served(str(root), tmp_path / "cache") as client:
        charts = client.get("/contents?format=json").json()
        html = client.get("/contents").text
    assert charts["Classes in view"] == {"wall": 3, "chair": 3}
    assert charts["Rooms"] == {"Kitchen": 3, "Bath": 1}
    assert charts["Objects in view"] == {"below 5": 4}
    assert charts["Light on the floor, lx"] == {"50 to 200": 1}
    sizes = charts["Size (items), % of the picture"]
    assert (sizes["5 to 20"], sizes["20 or more"]) == (0, 6)
    assert charts["Distance (items), m"] == {
        "below 1": 0, "1 to 2": 0, "2 to 3": 1, "3 to 5": 0, "5 or more": 1,
    }  # fmt: skip
    assert (charts["Layers"]["depth"], charts["Layers"]["mlt_il_ol"]) == (3, 4)
    assert charts["Selection"] == {}
    assert charts["Credits (homes)"] == {"by A. Person": 2}
    assert "4 views" in html
    assert '<meter min="0" max="3" value="1">' in html


def test_a_views_camera_is_python_to_paste(tmp_path: Path) -> None:
    camera = Camera.look_at((1, 1.5, 2), (3, 1, 2.5), size=(WIDTH, HEIGHT), hfov_deg=70)
    facts = {
        "K": camera.intrinsics.k.tolist(),
        "world_from_camera_opencv": opencv_world_from_camera(camera.world_from_camera).tolist(),
    }
    root = write_root(tmp_path / "root", {"a-1": ("0_0_1",)})
    write_view(root / "houses/a-1/views/0_0_2", **facts)
    write_view(root / "houses/a-1/views/0_0_3", **facts | {"lens": {"model": "fisheye"}})
    write_view(root / "houses/a-1/views/0_0_4", **facts | {"K": "__import__"})
    with served(str(root), tmp_path / "cache") as client:
        pages = [client.get(f"/homes/a-1/views/0_0_{k}").text for k in range(1, 5)]
    assert ["Copy this camera" in page for page in pages] == [False, True, False, False]
    (text,) = re.findall(r'id="camera">(.+?)</pre>', pages[1])
    pasted = eval(html.unescape(text), {"pf": pbrs_farm})
    np.testing.assert_allclose(pasted.world_from_camera, camera.world_from_camera, atol=1e-12)
    np.testing.assert_allclose(pasted.intrinsics.k, camera.intrinsics.k)


def test_the_card_of_a_home_shows_the_view_with_the_best_score(tmp_path: Path) -> None:
    root = write_root(tmp_path / "root", {"a-1": ()})
    for view, facts in {
        "0_0_1": {"score": 0.2},
        "0_0_2": {"score": 0.7},
        "0_0_3": {"score": 0.9, "warnings": ["dark"]},
        "0_0_4": {"score": "9"},
    }.items():
        write_view(root / "houses/a-1/views" / view, **facts)
    home = read_queries(root, tmp_path).home("a-1")
    assert home is not None
    assert home.cover is not None
    assert home.cover.id == "0_0_2"


@pytest.mark.parametrize(
    ("host", "connection", "hint"),
    [
        ("127.0.0.1", "192.0.2.7 50000 192.0.2.9 22", "ssh -L 8080:127.0.0.1:8080 ann@192.0.2.9"),
        ("127.0.0.1", "", ""),
        ("192.0.2.9", "192.0.2.7 50000 192.0.2.9 22", ""),
    ],
)
def test_over_ssh_the_board_says_how_to_reach_it(
    host: str,
    connection: str,
    hint: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    class Server:
        def run(self, sockets: list[socket.socket]) -> None:
            sockets[0].close()

    ports: list[int] = []

    def bound(_host: str, _port: int) -> socket.socket:
        listening = bound_socket("127.0.0.1", 0)
        ports.append(listening.getsockname()[1])
        return listening

    monkeypatch.setattr("pbrs_farm.board.serve.bound_socket", bound)
    monkeypatch.setattr("pbrs_farm.board.serve.server_of", lambda _board: Server())
    monkeypatch.setattr("pbrs_farm.commands.showing.getuser", lambda: "ann")
    monkeypatch.setenv("SSH_CONNECTION", connection)
    assert main(["board", str(tmp_path), "--host", host, "--cache", str(tmp_path / "cache")]) == 0
    said = capsys.readouterr().out
    assert ("ssh -L" in said) == bool(hint)
    assert hint.replace("8080", str(ports[0])) in said


def test_htmx_gets_only_the_results_and_a_normalised_address(client: httpx.Client) -> None:
    answer = client.get("/views?home=&room=Bath&words=", headers={"HX-Request": "true"})
    assert "<html" not in answer.text
    assert answer.headers["hx-push-url"] == "/views?room=Bath"
    back = {"HX-Request": "true", "HX-History-Restore-Request": "true"}
    assert "<html" in client.get("/views", headers=back).text


def test_a_selections_verdicts_are_filters(tmp_path: Path) -> None:
    root = write_root(tmp_path / "root", {"a-1": ("0_0_1", "0_0_2", "0_1_0")})
    (root / "selection").mkdir()
    (root / "selection.json").write_text(json.dumps({"run": "r1"}))
    lines = [{"house": "a-1", "view": "0_0_1", "reason": ""},
             {"house": "a-1", "view": "0_0_2", "reason": "too dark"}]  # fmt: skip
    (root / "selection/r1.jsonl").write_text("".join(json.dumps(x) + "\n" for x in lines))
    queries = read_queries(root, tmp_path)
    ids = {
        query: [v.id for v in queries.views(filter_from_query({"verdict": query})).rows]
        for query in ("kept", "refused", "unjudged")
    }
    assert ids == {"kept": ["0_0_1"], "refused": ["0_0_2"], "unjudged": ["0_1_0"]}
    assert queries.menus()["reason"] == [("too dark", "too dark (1)")]


def read_queries(root: Path, tmp_path: Path) -> Queries:
    index = ViewIndex(tmp_path / "index.sqlite")
    Refresher(RootReader(FolderStore(root)), index).refresh()
    return Queries(index)


def test_views_added_or_removed_by_a_run_appear_at_the_next_refresh(tmp_path: Path) -> None:
    root = write_root(tmp_path / "root", {"a-1": ("0_0_1",)})
    index = ViewIndex(tmp_path / "index.sqlite")
    refresher, queries = Refresher(RootReader(FolderStore(root)), index), Queries(index)
    refresher.refresh()
    write_view(root / "houses/a-1/views/0_0_9")
    write_house(root, "c-3", ("0_0_1",))
    refresher.refresh()
    assert queries.n_views() == 3
    for path in sorted((root / "houses/c-3").rglob("*"), reverse=True):
        path.rmdir() if path.is_dir() else path.unlink()
    (root / "houses/c-3").rmdir()
    refresher.refresh()
    assert queries.home("c-3") is None
    assert queries.n_views() == 2


class CountingStore(MemoryStore):
    """A store in memory that counts its listings."""

    n_listings = 0

    def list(self, prefix: str = "") -> Iterator[str]:
        self.n_listings += 1
        return super().list(prefix)


def test_a_store_with_a_manifest_or_a_farm_is_never_listed(tmp_path: Path) -> None:
    store = CountingStore()

    def finish(house: str, *views: str) -> bytes:
        files = [keys.house_key(house, "house.json")]
        files += [keys.view_key(house, v, f) for v in views for f in ("view.json", "depth.png")]
        for key in files:
            store.put(key, b"{}")
        rows = [canonical_json({"key": key, "sha256": "", "bytes": 2}) for key in sorted(files)]
        manifest = "".join(f"{row}\n" for row in rows).encode()
        store.put(keys.house_key(house, keys.MANIFEST), manifest)
        return manifest

    store.put(keys.MANIFEST, finish("a-1", "0_0_1") + finish("b-2", "0_0_1", "0_0_2"))
    finished: set[str] = set()
    index = ViewIndex(tmp_path / "index.sqlite")
    refresher = Refresher(RootReader(store), index, lambda: finished)
    queries = Queries(index)
    refresher.refresh()
    assert queries.n_views() == 3
    # A house that the farm finishes before the root's manifest is merged again.
    finish("c-3", "0_0_7")
    finished.add("c-3")
    refresher.refresh()
    entry = queries.view("c-3", "0_0_7")
    assert entry is not None
    assert entry.has("depth")
    # The merged manifest repeats each house's manifest: no file is read again.
    generation = index.generation
    store.put(keys.MANIFEST, b"".join(store.get(f"houses/{h}/manifest.jsonl") for h in HOMES))
    refresher.refresh()
    assert (index.generation, store.n_listings) == (generation, 0)


HOMES = ("a-1", "b-2", "c-3")


def test_a_store_with_neither_is_listed_seldom(root: Path) -> None:
    store, now = CountingStore(), [0.0]
    store.put("houses/a-1/house.json", b"{}")
    houses = StoredHouses(RootReader(store), clock=lambda: now[0])
    for now[0] in (0.0, 60.0, 120.0):
        assert list(houses.fingerprints()) == ["a-1"]
    n = store.n_listings
    now[0] = 700.0
    houses.fingerprints()
    assert store.n_listings == 2 * n


def test_a_store_that_is_no_folder_is_listed_alike(root: Path, tmp_path: Path) -> None:
    store = MemoryStore()
    for path in sorted(root.rglob("*")):
        if path.is_file():
            store.put(path.relative_to(root).as_posix(), path.read_bytes())
    index = ViewIndex(tmp_path / "index.sqlite")
    Refresher(RootReader(store), index).refresh()
    of_folder = read_queries(root, tmp_path / "folder")
    key = {"house", "id", "room", "layers", "classes"}
    rows = index.rows("SELECT house, id, room, layers, classes FROM view ORDER BY house, id")
    assert len(rows) == 4
    assert all(key == set(row.keys()) for row in rows)
    assert Queries(index).menus() == of_folder.menus()


def test_a_damaged_index_is_made_anew(root: Path, tmp_path: Path) -> None:
    (tmp_path / "index.sqlite").write_bytes(b"this is not a database" * 100)
    assert read_queries(root, tmp_path).n_views() == 4


def test_pages_cut_a_long_list_without_loss(tmp_path: Path) -> None:
    index = ViewIndex(tmp_path / "index.sqlite")
    views = tuple(ViewRow(f"0_0_{k:04}", "Hall", 1, 2, ()) for k in range(130))
    index.enter([(HouseRow("a-1", "Home", "", 1, views), "x")])
    queries = Queries(index)
    listed = [queries.views(filter_from_query({"page": str(k)})) for k in (1, 2, 3, 99)]
    assert [len(page.rows) for page in listed] == [48, 48, 34, 34]
    ids = [v.id for page in listed[:3] for v in page.rows]
    assert ids == [v.id for v in views]
    assert listed[3].number == 3


def test_a_view_with_every_layer_is_listed_with_each(tmp_path: Path) -> None:
    # An integer of SQLite has 64 bits, fewer than there are layers.
    index = ViewIndex(tmp_path / "i.sqlite")
    view = ViewRow("0_0_1", "Hall", (1 << len(LAYERS)) - 1, 2, ())
    index.enter([(HouseRow("a-1", "Home", "", 1, (view,)), "x")])
    queries = Queries(index)
    assert queries.view("a-1", "0_0_1").row()["layers"] == [layer.name for layer in LAYERS]
    assert len(queries.menus()["layer"]) == len(LAYERS) - 1


@pytest.mark.parametrize("text", ["", "0", "-1", "x", "1e9", "99999999999", "²"])
def test_a_page_that_is_no_number_is_the_first(text: str) -> None:
    assert page_number(text) == 1


def test_a_view_lists_its_items_its_files_and_its_seconds(root: Path, client: httpx.Client) -> None:
    marker = {"step": "light", "seconds": 12.5, "worker": "w7"}
    (root / "houses/a-1/done/light.0_0_1.json").write_text(json.dumps(marker))
    html = client.get(VIEW).text
    for text in (
        "Chair",
        "chair",
        "50.0 %",
        "12.50",
        "w7",
        "radiance.exr",
        "depth.png",
        "by A. Person",
    ):
        assert text in html
    assert 'href="/homes/a-1/views/0_0_2"' in html


def test_a_thumbnail_is_made_once_and_may_be_kept(root: Path, client: httpx.Client) -> None:
    first = client.get(f"{VIEW}/thumb/mlt_il_ol.jpg")
    assert decode_photo(first.content, "thumb").shape == (HEIGHT, WIDTH, 3)
    assert "immutable" in first.headers["cache-control"]
    assert client.get(f"{VIEW}/thumb/mlt_il_ol.jpg").content == first.content
    assert client.get(f"{VIEW}/thumb/hha.jpg").status_code == 404


def test_a_label_is_shown_in_colours_and_saved_unchanged(root: Path, client: httpx.Client) -> None:
    shown = array_from_png(client.get(f"{VIEW}/shown/instance.png").content)
    assert len(np.unique(shown.reshape(-1, 3), axis=0)) == 2
    stored = root / "houses/a-1/views/0_0_1/instance.png"
    saved = client.get(f"{VIEW}/file/instance")
    assert saved.content == stored.read_bytes()
    assert saved.headers["content-disposition"] == 'attachment; filename="a-1-0_0_1-instance.png"'


def test_the_probes_packet_holds_the_labels_of_every_pixel(client: httpx.Client) -> None:
    answer = client.get(f"{VIEW}/pixels")
    data = answer.content
    assert data[:4] == b"PBPX"
    assert struct.unpack_from("<III", data, 4) == (WIDTH, HEIGHT, 15)
    labels, n = label_arrays(), WIDTH * HEIGHT
    planes = [
        ("instance", "<u2", n),
        ("depth", "<u2", n),
        ("normal", "<u2", 3 * n),
        ("semantic", "<u1", n),
    ]
    start = 16
    for name, dtype, count in planes:
        plane = np.frombuffer(data, dtype, count, start)
        np.testing.assert_array_equal(plane, labels[name].reshape(-1))
        start += plane.nbytes
    assert start == len(data)


def test_scripts_are_sent_packed_and_kept_by_their_version(client: httpx.Client) -> None:
    plain = client.get("/static/view.js", headers={"Accept-Encoding": "identity"})
    assert b"import" in plain.content
    with client.stream("GET", "/static/view.js") as packed:
        assert gzip.decompress(b"".join(packed.iter_raw())) == plain.content
    again = client.get("/static/view.js", headers={"If-None-Match": plain.headers["etag"]})
    assert again.status_code == 304


def test_missing_pages_are_reported(client: httpx.Client) -> None:
    for path in ("/homes/zzz", "/homes/a-1/views/zzz", "/nothing"):
        answer = client.get(path)
        assert answer.status_code == 404
        assert "All homes" in answer.text


def test_a_home_that_is_gone_gets_a_page(tmp_path: Path) -> None:
    root = write_root(tmp_path / "root", {"a-1": ("0_0_1",), "b-2": ("0_0_4",)})
    with served(str(root), tmp_path / "cache") as client:
        shutil.rmtree(root / "houses/b-2")
        for path in ("/homes/b-2", "/homes/b-2/scene.json"):
            answer = client.get(path)
            assert answer.status_code == 404
            assert "is not in the root any more" in answer.text or "no home b-2" in answer.text
            assert "All homes" in answer.text
        answer = client.get("/homes/a-1/views/9_9_9")
        assert answer.status_code == 404
        assert "no view 9_9_9 of this home" in answer.text
        assert 'href="/homes/a-1"' in answer.text


def test_the_head_names_the_root_and_no_path_of_the_machine(
    client: httpx.Client, root: Path
) -> None:
    for path in ("/", "/views", "/homes/a-1", "/homes/a-1/views/0_0_1"):
        text = client.get(path).text
        assert f">{root.name}</span>" in text
        assert str(root.parent) not in text


def test_a_page_reports_that_the_root_is_being_read(tmp_path: Path) -> None:
    root = write_root(tmp_path / "root", {})
    board = new_board(
        store_from_url(str(root)), BoardOptions(cache=tmp_path, port=0, token=Secret(TOKEN))
    )
    # Without a server, which would start reading.
    transport = httpx.ASGITransport(application(board))

    async def answers() -> tuple[str, str]:
        async with httpx.AsyncClient(transport=transport, base_url="http://127.0.0.1") as client:
            progress, page = await client.get("/progress"), await client.get("/")
        return progress.json()["text"], page.text

    def progress_lines(progress: Progress) -> tuple[str, str]:
        board.refresher.progress = progress
        return asyncio.run(answers())

    # No file is read yet: the root may be large, and is not reported as empty.
    text, page = progress_lines(board.refresher.progress)
    assert "Looking for homes" in text
    assert text in page
    assert "root has no homes yet" not in page
    assert "reading.js" in page
    text, page = progress_lines(Progress(1200, 7))
    assert text.startswith("Reading homes: 7 of 1,200.")
    assert text in page
    board.refresher.refresh()
    text, page = progress_lines(board.refresher.progress)
    assert text == ""
    assert "root has no homes yet" in page
    assert "reading.js" not in page


def test_words_of_the_board_are_explained(client: httpx.Client) -> None:
    # Each rule of the sampler and each reason of a selection has an explanation.
    assert set(OF_A_CANDIDATE) == {v.label.replace("_", " ") for v in Verdict}
    assert set(OF_A_SELECTION) == {*REASONS, *RULE_REASONS.values()}
    page = html.unescape(client.get("/homes/a-1/views/0_0_1").text)
    for word in ("sector", "cropped", "visible"):
        assert f"<dt>{word}</dt><dd>{OF_A_VIEW[word]}</dd>" in page
    assert "<dt>noise</dt>" not in page  # not recorded in this view
    assert OF_A_CANDIDATE["below min score"] in html.unescape(client.get("/homes/a-1").text)
