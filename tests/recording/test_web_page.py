"""The page of the web viewer: rerun's own, but without what a browser would fetch elsewhere."""

import urllib.error
import urllib.request
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread

import pytest

from worldsim.recording.viewer import NOWHERE, viewer_environment
from worldsim.recording.web_page import LOOPBACK, POLICY, local_page, served_page

PAGE = """<!doctype html><html><head>
<link rel="icon" href="favicon.ico" />
<link rel="preconnect" href="https://fonts.gstatic.com" crossorigin />
<link
  href="https://fonts.googleapis.com/css2?family=Inter" rel="stylesheet" />
</head><body><script src="re_viewer.js"></script></body></html>"""
WASM = bytes(range(256)) * 4096


class Rerun(BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        html = self.path.startswith("/?")
        self.send_response(200 if html or self.path == "/re_viewer_bg.wasm" else 404)
        self.send_header("Content-Type", "text/html" if html else "application/wasm")
        self.send_header("rerun-final-length", str(len(WASM)))
        self.end_headers()
        self.wfile.write(PAGE.encode() if html else WASM)

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture
def address() -> Iterator[str]:
    with (
        ThreadingHTTPServer((LOOPBACK, 0), Rerun) as rerun,
        ThreadingHTTPServer((LOOPBACK, 0), Rerun) as probe,
    ):
        port = probe.server_address[1]
        probe.server_close()
        thread = Thread(target=rerun.serve_forever)
        thread.start()
        with served_page(port, rerun.server_address[1]):
            yield f"http://{LOOPBACK}:{port}"
        rerun.shutdown()
        thread.join()


def test_the_page_asks_no_other_host(address: str) -> None:
    with urllib.request.urlopen(f"{address}/?url=rerun%2Bhttp") as answer:
        html = answer.read().decode()
        assert answer.headers["Content-Security-Policy"] == POLICY
    assert html == local_page(PAGE)
    assert "https://" not in html
    assert 'href="favicon.ico"' in html
    assert html.index("window.fetch = ") < html.index("re_viewer.js"), "guarded before it starts"
    assert "connect-src 'self' data: blob: http://127.0.0.1:*" in POLICY


def test_everything_else_is_passed_on_as_it_is(address: str) -> None:
    with urllib.request.urlopen(f"{address}/re_viewer_bg.wasm") as answer:
        assert answer.read() == WASM
        assert answer.headers["Content-Type"] == "application/wasm"
        assert answer.headers["rerun-final-length"] == str(len(WASM))
    with pytest.raises(urllib.error.HTTPError, match="404") as missing:
        urllib.request.urlopen(f"{address}/nothing")
    missing.value.close()


def test_a_viewer_has_a_proxy_that_refuses(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("https_proxy", "http://proxy.example:3128")
    with viewer_environment("true") as environment:
        assert "https_proxy" not in environment
        assert {environment[name] for name in NOWHERE} == {"http://127.0.0.1:9"}
