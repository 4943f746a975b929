"""A real browser without a screen, and the program that makes the pages."""

from __future__ import annotations

import os
import shutil
import subprocess
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


def browse(browser: str, page: Path, *options: str) -> subprocess.CompletedProcess[str]:
    """Opens a page without a screen; the console comes on stderr."""
    profile = page.parent / "profile"
    command = [
        browser,
        "--headless=new",
        "--no-sandbox",
        "--use-angle=swiftshader",
        "--enable-unsafe-swiftshader",
        "--disable-dev-shm-usage",
        "--disable-background-networking",
        "--disable-component-update",
        "--enable-logging=stderr",
        f"--user-data-dir={profile}",
        "--virtual-time-budget=20000",
        *options,
        page.as_uri(),
    ]
    return subprocess.run(command, capture_output=True, text=True, timeout=180)
