"""A headless Chromium, driven through a pipe: no package is needed, only the browser itself."""

import base64
import json
import os
import shutil
import subprocess
import time

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")


def find_chromium():
    """Return the path of a browser; None where there is none."""
    return next((path for name in BROWSERS if (path := shutil.which(name))), None)


class Chromium:
    """One page in a browser; use it as a context manager.

    `messages` holds what the page logged: errors, warnings and exceptions.
    """

    def __init__(self, browser, profile, timeout_s=60.0):
        self.messages = []
        self._next, self._replies, self._buffer = 0, {}, b""
        self._deadline = time.monotonic() + timeout_s
        read_end, self._write = os.pipe()
        self._read, write_end = os.pipe()
        options = [
            "--headless=new", "--remote-debugging-pipe", "--no-sandbox", "--disable-gpu",
            "--disable-dev-shm-usage", "--no-first-run", "--hide-scrollbars",
            "--disable-background-networking", f"--user-data-dir={profile}", "about:blank",
        ]  # fmt: skip
        self._process = subprocess.Popen(
            ["bash", "-c", f'exec "$@" 3<&{read_end} 4>&{write_end}', "bash", browser, *options],
            pass_fds=(read_end, write_end),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(read_end)
        os.close(write_end)
        os.set_blocking(self._read, False)
        target = self._call("Target.createTarget", url="about:blank")["targetId"]
        attached = self._call("Target.attachToTarget", targetId=target, flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log"):
            self.call(f"{domain}.enable")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._process.kill()
        self._process.wait(10)
        os.close(self._write)
        os.close(self._read)

    def call(self, method, **parameters):
        """Call a method of the DevTools protocol on the page and return its result."""
        return self._call(method, self._session, **parameters)

    def open(self, path, *, width, height=900, dark=False):
        """Load a file at a width, in the light or the dark."""
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width, height=height, deviceScaleFactor=1, mobile=width < 600,
        )  # fmt: skip
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", features=[scheme])
        self.call("Page.navigate", url=path.resolve().as_uri())
        while self.run("document.readyState") != "complete" or "about:" in self.run(
            "location.href"
        ):
            self._pause()
        # Drawings follow the layout by two frames.
        self.run("new Promise(f => requestAnimationFrame(() => requestAnimationFrame(f)))")

    def run(self, script):
        """Return the value of a JavaScript expression."""
        result = self.call(
            "Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True
        )
        assert "exceptionDetails" not in result, result
        return result["result"].get("value")

    def drag(self, x, y, dx, dy):
        """Press the mouse at a point and drag it."""
        for kind, left, top in (
            ("mousePressed", x, y),
            ("mouseMoved", x + dx, y + dy),
            ("mouseReleased", x + dx, y + dy),
        ):
            self.call(
                "Input.dispatchMouseEvent",
                type=kind, x=left, y=top, button="left", buttons=1, clickCount=1,
            )  # fmt: skip

    def screenshot(self, path):
        """Write a picture of the whole page."""
        size = self.call("Page.getLayoutMetrics")["cssContentSize"]
        clip = {"x": 0, "y": 0, "width": size["width"], "height": size["height"], "scale": 1}
        shot = self.call("Page.captureScreenshot", clip=clip, captureBeyondViewport=True)
        path.write_bytes(base64.b64decode(shot["data"]))

    def _call(self, method, session=None, **parameters):
        self._next += 1
        number = self._next
        message = {"id": number, "method": method, "params": parameters}
        if session is not None:
            message["sessionId"] = session
        os.write(self._write, json.dumps(message).encode() + b"\0")
        while number not in self._replies:
            self._receive()
        reply = self._replies.pop(number)
        assert "error" not in reply, reply["error"]
        return reply["result"]

    def _receive(self):
        try:
            self._buffer += os.read(self._read, 1 << 20)
        except BlockingIOError:
            self._pause()
        *messages, self._buffer = self._buffer.split(b"\0")
        for message in map(json.loads, messages):
            if "id" in message:
                self._replies[message["id"]] = message
            else:
                self._note(message)

    def _note(self, event):
        parameters = event.get("params", {})
        if event["method"] == "Runtime.exceptionThrown":
            self.messages.append(str(parameters["exceptionDetails"]))
        elif event["method"] == "Log.entryAdded":
            self.messages.append(str(parameters["entry"]["text"]))
        elif event["method"] == "Runtime.consoleAPICalled":
            self.messages.append(str(parameters["args"]))

    def _pause(self):
        if time.monotonic() > self._deadline or self._process.poll() is not None:
            raise TimeoutError("the browser does not answer")
        time.sleep(0.01)
