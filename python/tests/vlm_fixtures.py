"""Two mallets, their files, and an endpoint to ask."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from fake_endpoint import fake_endpoint
from mesh_views_builder import mallet, write_mesh_views, write_region

#: Looks like nothing else, so that it can be looked for.
KEY = "sk-test-Zq8X3vJ7mK2pR5tW"


@dataclass(frozen=True)
class Files:
    """Files of one object, and which of its vertices are the region's."""

    views: Path
    region: Path
    inside: np.ndarray


@pytest.fixture(scope="session")
def mallets(tmp_path_factory) -> dict[str, Files]:
    """``short`` and ``long``: the same tool, other proportions."""
    folder = tmp_path_factory.mktemp("mallets") / "tools"
    folder.mkdir()
    files = {}
    for name, length in (("short", 1.6), ("long", 2.4)):
        vertices, triangles, inside = mallet(length)
        views = write_mesh_views(folder / f"{name}.views.mcap", vertices, triangles)
        files[name] = Files(views, write_region(folder / f"{name}.json", inside), inside)
    return files


@pytest.fixture
def endpoint(monkeypatch):
    """A fake endpoint that the environment points to, with the key :data:`KEY`."""
    for name in ("OPENAI_API_KEY", "OPENAI_BASE_URL", "OPENAI_MODEL"):
        monkeypatch.delenv(name, raising=False)
    with fake_endpoint() as fake:
        monkeypatch.setenv("SEMFM_VLM_BASE_URL", fake.url)
        monkeypatch.setenv("SEMFM_VLM_MODEL", "fake")
        monkeypatch.setenv("SEMFM_VLM_API_KEY", KEY)
        monkeypatch.setenv("NO_PROXY", "127.0.0.1")
        yield fake
