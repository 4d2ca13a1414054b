"""Drive a headless Chromium by its DevTools protocol, to test HTML pages."""

import asyncio
import base64
import json
import os
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

#: Names of the program.
NAMES = ("chromium", "chromium-browser", "google-chrome")
PATIENCE = 120.0


def program():
    """Return the path of a Chromium, None where there is none."""
    return next((found for name in NAMES if (found := shutil.which(name))), None)


class Browser:
    """A page in a Chromium without network; records console messages, errors and requests."""

    def __init__(self):
        self.profile = tempfile.mkdtemp(prefix="chromium-")
        options = ["--headless=new", "--disable-gpu", "--no-first-run", "--remote-debugging-port=0"]
        options += ["--disable-extensions"]
        options += ["--disable-background-networking", "--disable-component-update", f"--user-data-dir={self.profile}"]
        options += ["--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1"]
        if os.geteuid() == 0:
            options.append("--no-sandbox")
        self.process = subprocess.Popen(
            [program(), *options, "about:blank"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            stdin=subprocess.DEVNULL,
        )
        self.loop = asyncio.new_event_loop()
        self.number, self.told, self.requests = 0, [], []
        self.socket = self.loop.run_until_complete(self._connect())
        for room in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{room}.enable")

    async def _connect(self):
        from tornado.httpclient import AsyncHTTPClient
        from tornado.websocket import websocket_connect

        port, end = Path(self.profile, "DevToolsActivePort"), time.monotonic() + PATIENCE
        while not (port.exists() and port.read_text().count("\n")):
            assert self.process.poll() is None, "Chromium ended"
            assert time.monotonic() < end, "Chromium did not start"
            await asyncio.sleep(0.05)
        address = f"http://127.0.0.1:{port.read_text().splitlines()[0]}/json"
        pages = json.loads((await AsyncHTTPClient().fetch(address)).body)
        place = next(page["webSocketDebuggerUrl"] for page in pages if page["type"] == "page")
        return await websocket_connect(place, max_message_size=2**28)

    async def _next(self):
        message = json.loads(await self.socket.read_message())
        if message.get("method") == "Runtime.exceptionThrown":
            self.told.append(message["params"]["exceptionDetails"]["exception"]["description"])
        elif message.get("method") == "Log.entryAdded":
            self.told.append(message["params"]["entry"]["text"])
        elif message.get("method") == "Runtime.consoleAPICalled" and message["params"]["type"] in ("error", "warning"):
            self.told.append(" ".join(str(one.get("value")) for one in message["params"]["args"]))
        elif message.get("method") == "Network.requestWillBeSent":
            self.requests.append(message["params"]["request"]["url"])
        return message

    async def _call(self, method, options):
        self.number += 1
        number = self.number
        await self.socket.write_message(json.dumps({"id": number, "method": method, "params": options}))
        while (message := await asyncio.wait_for(self._next(), PATIENCE)).get("id") != number:
            pass
        assert "error" not in message, message
        return message["result"]

    def call(self, method, **options):
        """Call a method of the protocol."""
        return self.loop.run_until_complete(self._call(method, options))

    def open(self, address):
        """Open a page and wait until it is loaded."""
        self.told.clear()
        self.requests.clear()
        self.call("Page.navigate", url=address)
        self.until("document.readyState === 'complete' && location.href !== 'about:blank'")

    def js(self, code):
        """Return the value of an expression; wait for a promise."""
        found = self.call("Runtime.evaluate", expression=code, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in found, found["exceptionDetails"]
        return found["result"].get("value")

    def until(self, code):
        """Wait until an expression is true, and return it."""
        end = time.monotonic() + PATIENCE
        while not (found := self.js(code)):
            assert time.monotonic() < end, f"never: {code}"
            time.sleep(0.05)
        return found

    def media(self, media="screen", scheme="light"):
        """Show the page on a screen or on paper, light or dark."""
        self.call(
            "Emulation.setEmulatedMedia", media=media, features=[{"name": "prefers-color-scheme", "value": scheme}]
        )

    def size(self, width, height=900):
        """Give the window a size."""
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)

    def mouse(self, x, y):
        """Move the mouse."""
        self.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)

    def press(self, key, text=""):
        """Press a key."""
        code = {"Tab": 9, "Enter": 13, " ": 32, "ArrowDown": 40}[key]
        common = {"key": key, "code": {" ": "Space"}.get(key, key), "windowsVirtualKeyCode": code}
        self.call("Input.dispatchKeyEvent", type="keyDown", text=text, **common)
        self.call("Input.dispatchKeyEvent", type="keyUp", **common)

    def pdf(self, path):
        """Print the page."""
        Path(path).write_bytes(base64.b64decode(self.call("Page.printToPDF", printBackground=False)["data"]))

    def close(self):
        """End the program."""
        self.loop.run_until_complete(self._ended())
        self.loop.close()
        self.process.wait(PATIENCE)
        shutil.rmtree(self.profile, ignore_errors=True)

    async def _ended(self):
        self.number += 1
        await self.socket.write_message(json.dumps({"id": self.number, "method": "Browser.close"}))
        while await self.socket.read_message() is not None:
            pass
        self.socket.close()
        await asyncio.sleep(0)  # for the connection to be let go of
