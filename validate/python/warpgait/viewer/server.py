"""The page of a solve, served to browsers on this machine: `/` is the page, `/events` tells it what is new."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from types import TracebackType
from typing import Any

from ..errors import InputError

_HERE = "127.0.0.1"
_PATIENCE = 0.5  # s between two signs of life
_WAITING = """<!doctype html><html lang="en"><meta charset="utf-8"><title>warpgait</title><link rel="icon" href="data:,">
<p style="font:16px system-ui,sans-serif">Ground and map come first; the motion follows.</p>
<script>new EventSource("/events").onmessage = () => location.reload();</script></html>"""


class Server:
    """Serves one page and what is new to all that look at it. Use it as a context."""

    def __init__(self, port: int = 0) -> None:
        """A port of 0 is one that is free; raises `InputError` if the port cannot be had."""
        self._changed = threading.Condition()
        self._page: Callable[[], str] = lambda: _WAITING
        self._news, self._number = b"", 0
        self._last = False
        self.shown = threading.Event()
        """The last page was sent to a browser."""
        served = self

        class Handler(BaseHTTPRequestHandler):
            """Answers one request."""

            def do_GET(self) -> None:
                """Send the page, or what is new until the browser goes away."""
                served._answer(self)

            def log_message(self, format: str, *args: Any) -> None:
                """Say nothing."""

        try:
            self._server = ThreadingHTTPServer((_HERE, port), Handler)
        except (OSError, OverflowError) as error:
            why = getattr(error, "strerror", None) or "it is not a number from 0 to 65535"
            raise InputError(f"--port {port}: {why}; leave it out to take one that is free") from error
        self._server.daemon_threads, self._server.block_on_close = True, False
        self.address = f"http://{_HERE}:{self._server.server_port}/"

    def __enter__(self) -> Server:
        """Begin to serve."""
        threading.Thread(target=self._server.serve_forever, args=(0.1,), daemon=True).start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        """Stop."""
        self._server.shutdown()
        self._server.server_close()

    def show(self, page: Callable[[], str], news: dict[str, Any], last: bool = False) -> None:
        """From now on serve this page, and tell those who look at an earlier one what is new."""
        with self._changed:
            self._page, self._news, self._last = page, json.dumps(news, separators=(",", ":")).encode(), last
            self._number += 1
            self._changed.notify_all()

    def _answer(self, request: BaseHTTPRequestHandler) -> None:
        # Pages of other sites reach this address under other names.
        if request.headers.get("Host") not in [f"{name}:{self._server.server_port}" for name in (_HERE, "localhost")]:
            request.send_error(HTTPStatus.FORBIDDEN)
        elif request.path == "/events":
            self._tell(request)
        elif request.path == "/":
            with self._changed:
                made, last = self._page, self._last
            page = made().encode()
            request.send_response(HTTPStatus.OK)
            request.send_header("Content-Type", "text/html; charset=utf-8")
            request.send_header("Content-Length", str(len(page)))
            request.send_header("Cache-Control", "no-store")
            request.end_headers()
            request.wfile.write(page)
            if last:
                self.shown.set()
        else:
            request.send_error(HTTPStatus.NOT_FOUND)

    def _tell(self, request: BaseHTTPRequestHandler) -> None:
        """Send what is new, the newest only, until the browser has gone."""
        request.send_response(HTTPStatus.OK)
        request.send_header("Content-Type", "text/event-stream")
        request.send_header("Cache-Control", "no-store")
        request.end_headers()
        seen = 0
        try:
            while True:
                with self._changed:
                    self._changed.wait_for(lambda seen=seen: self._number > seen, _PATIENCE)  # type: ignore[misc]
                    news, is_new = self._news, self._number > seen
                    seen = self._number
                request.wfile.write(b"data: " + news + b"\n\n" if is_new else b":\n\n")
        except OSError:
            return
