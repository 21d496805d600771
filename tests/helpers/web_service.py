"""A web server in a thread that answers as it is told, failures included."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import parse_qs, urlsplit


@dataclass
class Answer:
    """What the server sends: `cut_at` bytes of the content, then it hangs up."""

    content: bytes = b""
    status: int = 200
    kind: str = "application/octet-stream"
    cut_at: int | None = None
    headers: dict[str, str] = field(default_factory=dict)


@dataclass
class Asked:
    """A request that came."""

    path: str
    query: dict[str, str]
    range_from: int | None


@dataclass
class Service:
    """The server's address, what it was asked, and what it answers to which request."""

    url: str
    answer: Callable[[Asked, int], Answer]
    asked: list[Asked] = field(default_factory=list)


@contextmanager
def web_service(answer: Callable[[Asked, int], Answer]) -> Iterator[Service]:
    """Serve on a free port; `answer` gets a request and how many there were before."""
    service = Service("", answer)

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            parts = urlsplit(self.path)
            wanted = self.headers.get("Range")
            asked = Asked(
                parts.path,
                {key: values[0] for key, values in parse_qs(parts.query).items()},
                None if wanted is None else int(wanted.removeprefix("bytes=").rstrip("-")),
            )
            service.asked.append(asked)
            reply = service.answer(asked, len(service.asked) - 1)
            self.send_response(reply.status)
            self.send_header("Content-Type", reply.kind)
            self.send_header("Content-Length", str(len(reply.content)))
            for name, value in reply.headers.items():
                self.send_header(name, value)
            self.end_headers()
            self.wfile.write(reply.content[: reply.cut_at])

        def log_message(self, *_: object) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    service.url = f"http://127.0.0.1:{server.server_port}"
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    try:
        yield service
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


def ranged(content: bytes, asked: Asked, **options: object) -> Answer:
    """Answer as a file server does that knows ranges."""
    headers = {"ETag": '"one"', "Accept-Ranges": "bytes"}
    if asked.range_from is None:
        return Answer(content, headers=headers, **options)
    rest = content[asked.range_from :]
    headers["Content-Range"] = f"bytes {asked.range_from}-{len(content) - 1}/{len(content)}"
    return Answer(rest, status=206, headers=headers, **options)
