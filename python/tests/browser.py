"""A real browser without a screen, and the program that makes the pages."""

from __future__ import annotations

import base64
import hashlib
import json
import os
import re
import shutil
import subprocess
import threading
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")


def semfm_cli() -> str:
    """The built program: $SEMFM_CLI, or in target/."""
    built = [ROOT / "target" / profile / "semfm-cli" for profile in ("debug", "release")]
    program = os.environ.get("SEMFM_CLI") or next((str(p) for p in built if p.is_file()), None)
    if program is None:
        pytest.skip("no semfm-cli: neither $SEMFM_CLI nor in target/")
    return program


@pytest.fixture(scope="module")
def browser() -> str:
    for name in BROWSERS:
        if found := shutil.which(name):
            return found
    pytest.skip(f"no browser: none of {', '.join(BROWSERS)} is on the PATH")


def command_line(browser: str, page: Path, *options: str) -> list[str]:
    return [
        browser,
        "--headless=new",
        "--no-sandbox",
        "--use-angle=swiftshader",
        "--enable-unsafe-swiftshader",
        "--disable-dev-shm-usage",
        "--disable-background-networking",
        "--disable-component-update",
        "--enable-logging=stderr",
        f"--user-data-dir={page.parent / 'profile'}",
        "--window-size=1280,900",
        *options,
        page.as_uri(),
    ]


def browse(browser: str, page: Path, *options: str) -> subprocess.CompletedProcess[str]:
    """Opens a page without a screen, its clock run ahead; the console comes on stderr."""
    command = command_line(browser, page, "--virtual-time-budget=20000", *options)
    return subprocess.run(command, capture_output=True, text=True, timeout=180)


def with_probe(page: str, added: str) -> str:
    """The page with HTML at its end, whose one program the page's policy lets run."""
    (program,) = re.findall("<script>(.*?)</script>", added, re.S)
    digest = base64.b64encode(hashlib.sha256(program.encode()).digest()).decode()
    assert page.count("script-src 'sha256-") == 1, "the page has no policy"
    allowed = page.replace("script-src ", f"script-src 'sha256-{digest}' ")
    return allowed.replace("</body>", added + "</body>")


#: Runs `PROBE`, the body of an async function, and tells what it returns.
SCRIPT = """<script>
addEventListener("load", async () => {
  const frame = () => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)));
  try { console.log("told " + JSON.stringify(await (async () => { PROBE })())); }
  catch (error) { console.log("told " + JSON.stringify({ error: String(error.stack) })); }
});
</script>
"""


def probe(browser: str, page: Path, body: str, *options: str, seconds: float = 120):
    """What `body`, the body of an async function, returns inside a page with a real clock, and what
    else the console said."""
    probed = page.parent / f"probed-{page.name}"
    script = SCRIPT.replace("PROBE", body)
    probed.write_text(with_probe(page.read_text(), script))
    command = command_line(browser, probed, "--remote-debugging-port=0", *options)
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, errors="replace")
    watch = threading.Timer(seconds, process.kill)
    watch.start()
    told, console = None, []
    try:
        for line in process.stderr:
            if ":CONSOLE" not in line:
                continue
            if '"told {' in line:
                told = json.loads(line[line.index('"told {') + 6 : line.rindex('", source:')])
                break
            console.append(line.strip())
    finally:
        watch.cancel()
        process.kill()
        process.wait()
        process.stderr.close()
    assert told is not None, "the page told nothing: " + "\n".join(console)
    assert "error" not in told, told["error"]
    return told, console
