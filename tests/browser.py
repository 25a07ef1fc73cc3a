"""A headless Chromium, driven over the WebDriver protocol (w3.org/TR/webdriver2) with nothing but the standard library."""

import base64
import json
import shutil
import socket
import subprocess
import time
import urllib.error
import urllib.request
from contextlib import contextmanager

import pytest

MISSING = [name for name in ("chromium", "chromedriver") if shutil.which(name) is None]
WANTING = f"not installed: {', '.join(MISSING)} (packages chromium, chromium-driver)"
needs_browser = pytest.mark.skipif(bool(MISSING), reason=WANTING)

FOR_EVER = 600
"""s on the clock after which what has not come will not come; a busy machine needs a few."""


class Browser:
    """One window."""

    def __init__(self, port, folder, width, height):
        self.base = f"http://127.0.0.1:{port}"
        options = ["--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", f"--user-data-dir={folder}",
                   f"--window-size={width},{height}"]
        capabilities = {"browserName": "chrome", "goog:chromeOptions": {"args": options}, "goog:loggingPrefs": {"browser": "ALL"}}
        answer = self.send("POST", "/session", {"capabilities": {"alwaysMatch": capabilities}})
        self.session = f"/session/{answer['sessionId']}"

    def send(self, method, path, body=None):
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(self.base + path, data=data, method=method, headers={"Content-Type": "application/json"})
        try:
            with urllib.request.urlopen(request, timeout=FOR_EVER) as answer:
                return json.load(answer)["value"]
        except urllib.error.HTTPError as error:
            with error:
                raise AssertionError(error.read().decode()[:500]) from None

    def open(self, path):
        self.send("POST", f"{self.session}/url", {"url": path.resolve().as_uri()})

    def run(self, script, *arguments):
        return self.send("POST", f"{self.session}/execute/sync", {"script": script, "args": list(arguments)})

    def wait(self, script, seconds=FOR_EVER):
        end = time.monotonic() + seconds
        while not self.run(script):
            assert time.monotonic() < end, f"still not true after {seconds} s: {script}"
            time.sleep(0.05)

    def complaints(self):
        """What the console says is wrong."""
        return [entry["message"] for entry in self.send("POST", f"{self.session}/se/log", {"type": "browser"}) if entry["level"] != "INFO"]

    def picture(self, path):
        path.write_bytes(base64.b64decode(self.send("GET", f"{self.session}/screenshot")))

    def paper(self, path):
        path.write_bytes(base64.b64decode(self.send("POST", f"{self.session}/print", {"background": True})))

    def resize(self, width, height):
        """Set the size of the page, below what a window can be."""
        command = {"cmd": "Emulation.setDeviceMetricsOverride",
                   "params": {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 700}}
        self.send("POST", f"{self.session}/goog/cdp/execute", command)


@contextmanager
def browser(folder, width=1280, height=900):
    """Start a driver with one window; `folder` takes its profile."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    driver = subprocess.Popen([shutil.which("chromedriver"), f"--port={port}"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    window = None
    try:
        end = time.monotonic() + FOR_EVER
        while True:
            try:
                socket.create_connection(("127.0.0.1", port), timeout=1).close()
                break
            except OSError:
                assert time.monotonic() < end, "chromedriver does not answer"
                time.sleep(0.05)
        window = Browser(port, folder, width, height)
        yield window
    finally:
        if window is not None:
            window.send("DELETE", window.session)
        driver.terminate()
        driver.wait(10)
