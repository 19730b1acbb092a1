"""The page of the web viewer, served again so that a browser asks no other host for anything.

Rerun's own page names fonts elsewhere, and its viewer sends usage reports, which no option forbids.
This one is the same page without them: what would go to another host is answered within the page,
and the browser is told to refuse the rest.
"""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from http.client import HTTPConnection, HTTPException
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from shutil import copyfileobj
from threading import Thread
from typing import Any

LOOPBACK = "127.0.0.1"
WITHIN_S = 10.0
KEPT_HEADERS = ("Content-Type", "Content-Length", "rerun-final-length")
POLICY = (
    "default-src 'self' 'unsafe-inline' 'unsafe-eval' data: blob:;"
    f" connect-src 'self' data: blob: http://{LOOPBACK}:*"
)
"""The Content-Security-Policy: scripts and data come from this host alone."""
_GUARD = """<script>
{
  const fetched = window.fetch;
  window.fetch = (wanted, options) => {
    const host = new URL(wanted.url ?? wanted, location.href).hostname;
    return host === location.hostname ? fetched(wanted, options) : Promise.resolve(new Response());
  };
}
</script>"""
_OTHER_HOST = re.compile(r"<link\b[^>]*https?://[^>]*>")


def local_page(html: str) -> str:
    """Return rerun's page without links to other hosts, and with requests to them answered."""
    return _OTHER_HOST.sub("", html).replace("<head>", f"<head>{_GUARD}", 1)


@contextmanager
def served_page(page: int, source: int) -> Iterator[None]:
    """Serve at port ``page`` what rerun serves at ``source``, both on loopback, for this block.

    Raises OSError where the port is taken.
    """

    class Handler(_PageHandler):
        source_port = source

    with ThreadingHTTPServer((LOOPBACK, page), Handler) as server:
        server.daemon_threads = True
        thread = Thread(target=server.serve_forever, name="web-page", daemon=True)
        thread.start()
        try:
            yield
        finally:
            server.shutdown()
            thread.join()


class _PageHandler(BaseHTTPRequestHandler):
    """Answers from rerun's own server; its page is changed on the way."""

    source_port: int

    def do_GET(self) -> None:
        source = HTTPConnection(LOOPBACK, self.source_port, timeout=WITHIN_S)
        try:
            source.request("GET", self.path)
            self._pass_on(source.getresponse())
        except (ConnectionError, TimeoutError, HTTPException):
            self.close_connection = True
        finally:
            source.close()

    def _pass_on(self, answer: Any) -> None:
        html = answer.headers.get_content_type() == "text/html"
        changed = local_page(answer.read().decode()).encode() if html else None
        self.send_response(answer.status)
        for name in KEPT_HEADERS:
            if name in answer.headers and changed is None:
                self.send_header(name, answer.headers[name])
        self.send_header("Content-Security-Policy", POLICY)
        if changed is None:
            self.end_headers()
            copyfileobj(answer, self.wfile)
            return
        self.send_header("Content-Type", "text/html; charset=utf-8")
        self.send_header("Content-Length", str(len(changed)))
        self.end_headers()
        self.wfile.write(changed)

    def log_message(self, *_: Any) -> None:
        """Print nothing."""
