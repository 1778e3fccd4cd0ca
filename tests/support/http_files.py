"""A web server on the loopback interface, with files from the test."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Event, Thread

from support.waiting import PATIENCE


class Files:
    """The server's files, by path.

    For ``slow`` paths it sends only the head of a response; for ``trickling`` ones it sends a byte
    now and then, for ``cut`` ones it closes the connection in the middle; ``moved`` ones are redirected.
    """

    def __init__(self) -> None:
        self.files: dict[str, bytes] = {}
        self.slow: set[str] = set()
        self.trickling: set[str] = set()
        self.cut: set[str] = set()
        self.moved: dict[str, str] = {}
        self.asked: list[str] = []
        """Requested paths, in order."""
        self.open = 0
        """Responses in progress."""
        self.closing = Event()
        self.address = ""

    def put(self, path: str, content: bytes) -> str:
        """Serve ``content`` under ``path``; return the link."""
        self.files[path] = content
        return f"{self.address}{path}"


class _Server(ThreadingHTTPServer):
    def __init__(self, files: Files) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.files = files


@contextmanager
def served_files() -> Iterator[Files]:
    """Serve until the block ends."""
    files = Files()
    server = _Server(files)
    files.address = f"http://127.0.0.1:{server.server_address[1]}"
    thread = Thread(target=server.serve_forever, name="file server", daemon=True)
    thread.start()
    try:
        yield files
    finally:
        files.closing.set()
        server.shutdown()
        server.server_close()
        thread.join(PATIENCE)


class _Handler(BaseHTTPRequestHandler):
    server: _Server

    def do_GET(self) -> None:
        self.server.files.asked.append(self.path)
        self.server.files.open += 1
        with suppress(OSError):
            self._answer()
        self.server.files.open -= 1

    def _answer(self) -> None:
        if self.path in self.server.files.moved:
            self.send_response(302)
            self.send_header("Location", self.server.files.moved[self.path])
            self.end_headers()
            return
        content = self.server.files.files.get(self.path)
        if content is None:
            self.send_error(404)
            return
        self.send_response(200)
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        if self.path in self.server.files.slow:
            self.server.files.closing.wait()
        elif self.path in self.server.files.trickling:
            self._trickle(content)
        else:
            self.wfile.write(content[: len(content) // 2] if self.path in self.server.files.cut else content)

    def _trickle(self, content: bytes) -> None:
        for each in content:
            if self.server.files.closing.wait(0.02):
                return
            self.wfile.write(bytes([each]))

    def log_message(self, *_: object) -> None:
        """Log nothing."""
