"""Options and fixtures of the sidecar's tests."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from vlm_fixtures import endpoint, mallets  # noqa: F401


def pytest_addoption(parser):
    parser.addoption("--full", action="store_true", help="also the tests that need torch, or a browser")


def pytest_collection_modifyitems(config, items):
    if config.getoption("--full") or os.environ.get("SEMFM_FULL") == "1":
        return
    skip = pytest.mark.skip(reason="needs torch, or a browser: run with --full")
    for item in items:
        if "full" in item.keywords:
            item.add_marker(skip)


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of shared data: $SEMFM_SHARED, or ../shared beside the repository."""
    root = Path(__file__).resolve().parents[2]
    folder = Path(os.environ.get("SEMFM_SHARED") or root.parent / "shared")
    if not folder.is_dir():
        pytest.skip(f"no shared data: neither $SEMFM_SHARED nor {folder}")
    return folder
