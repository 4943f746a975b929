"""The page of `semfm-cli show` in a real browser, and the colours of the meshes that it reads."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
from browser import browse, browser, semfm_cli  # noqa: F401

pytestmark = pytest.mark.full

#: Appended to a copy of the page: draws, points at the middle of the source, changes the layer.
PROBE = """
<pre id="probe"></pre><script>
addEventListener('load', () => setTimeout(() => {
  const [source, target] = window.semfmPanels[0];
  const told = {n: [source.n, target.n], errors: [], marked: [], loaded: performance
    .getEntriesByType('resource').map((e) => e.name).filter((name) => !name.startsWith('data:'))};
  for (const panel of [source, target]) { panel.open(); told.errors.push(panel.gl.getError()); }
  for (let v = 0; v < source.n && !told.marked.length; v += 50) {
    source.hover(v);
    const marks = [source, target].map((panel) => panel.marks.filter((m) => m > 0).length);
    if (marks[0] && marks[1]) told.marked = marks;
  }
  source.leave();
  told.left = source.marks.filter((m) => m > 0).length;
  const buttons = [...document.querySelectorAll('.layers button')];
  told.layers = buttons.map((b) => b.textContent);
  buttons[1].click();
  told.layer = [source.layer, target.layer];
  document.getElementById('probe').textContent = JSON.stringify(told);
}, 1000));
</script>
"""


@pytest.fixture(scope="module")
def demo(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("show")
    program = semfm_cli()
    page = ["show", out / "transfer", "-o", out / "page.html"]
    for arguments in (["demo", "-q", "-o", out], page):
        done = subprocess.run([program, *arguments], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    return out


def test_pointing_at_the_source_lights_the_target(browser, demo, tmp_path):  # noqa: F811
    page = demo / "page.html"
    probed = tmp_path / "probed.html"
    probed.write_text(page.read_text().replace("</body>", PROBE + "</body>"))
    seen = browse(browser, probed, "--dump-dom", "--window-size=1280,900")
    found = re.search(r'<pre id="probe">(.*?)</pre>', seen.stdout, re.S)
    assert found and found[1], seen.stderr[-2000:]
    told = json.loads(found[1])
    assert told["loaded"] == [] and told["errors"] == [0, 0]
    assert told["n"] == [3000, 3000]
    assert told["marked"] and all(count > 3 for count in told["marked"])
    assert told["left"] == 0
    assert told["layers"] == ["region", "colour transfer", "anchors"]
    assert told["layer"] == [1, 1]
    complaints = [line for line in seen.stderr.splitlines() if ":CONSOLE" in line]
    assert not [line for line in complaints if "GPU stall" not in line], complaints


def test_trimesh_sees_the_colours_that_were_written(demo):
    trimesh = pytest.importorskip("trimesh")
    region = json.loads((demo / "transfer" / "region.json").read_text())
    inside = np.zeros(3000, bool)
    inside[region["vertices"]] = True
    for name in ("target.ply", "target.glb"):
        mesh = trimesh.load(demo / "transfer" / name, process=False, force="mesh")
        red, green = mesh.visual.vertex_colors[:, 0].astype(int), mesh.visual.vertex_colors[:, 1]
        assert len(red) == 3000
        # The region is where red outweighs green by half of the way from grey to red.
        assert ((red - green > 70) == inside).mean() > 0.99, name
