"""The evaluation's page in a real browser: it loads alone, says nothing on the console, and its
tables and gallery can be sorted. Needs `chromium` and the built `semfm-cli`."""

from __future__ import annotations

import json
import re
import subprocess
from html.parser import HTMLParser
from pathlib import Path

import pytest
from browser import browse, browser, semfm_cli, with_probe  # noqa: F401

pytestmark = pytest.mark.full

#: Appended to a copy of the page: clicks, and writes down what came of it.
PROBE = """
<pre id="probe"></pre><script>
addEventListener('load', () => {
  const values = (table, column) => [...table.tBodies[0].rows]
    .map((row) => row.cells[column].dataset.v).filter((v) => v !== undefined).map(Number);
  const table = document.querySelector('#scores table.sortable');
  const button = table.tHead.rows[0].cells[1].querySelector('button');
  button.click(); const up = values(table, 1);
  button.click(); const down = values(table, 1);
  const controls = document.getElementById('controls');
  const shown = () => [...document.querySelectorAll('.card')].filter((card) => !card.hidden)
    .map((card) => [card.dataset.method, Number(card.dataset.iou)]);
  const choose = (name, value) => {
    controls.elements[name].value = value;
    controls.elements[name].dispatchEvent(new Event('input', { bubbles: true }));
    return shown();
  };
  const gallery = { first: shown(), best: choose('order', 'best'), all: choose('method', ''),
    wks: choose('method', 'wks'), none: choose('words', 'no such object') };
  const images = [...document.querySelectorAll('img')];
  images.forEach((image) => { image.loading = 'eager'; });
  setTimeout(() => {
    const broken = images.filter((image) => !image.complete || !image.naturalWidth)
      .map((image) => image.alt);
    document.getElementById('probe').textContent = JSON.stringify({
      up, down, gallery, count: controls.elements.count.value,
      broken, images: images.length,
      loaded: performance.getEntriesByType('resource').map((e) => e.name)
        .filter((name) => !name.startsWith('data:')),
      overflow: document.documentElement.scrollWidth - innerWidth,
    });
  }, 5000);
});
</script>
"""


@pytest.fixture(scope="module")
def page(tmp_path_factory) -> Path:
    program = semfm_cli()
    out = tmp_path_factory.mktemp("report")
    small = "--synthetic --level easy --seeds 0 --objects 2 --methods fused,wks,whole --quiet".split()
    done = subprocess.run([program, "eval", *small, "-o", out], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return out / "index.html"


class Outline(HTMLParser):
    """What a reader without eyes or without scripts gets."""

    def __init__(self) -> None:
        super().__init__()
        self.headings: list[int] = []
        self.nameless: list[str] = []
        self.addresses: list[str] = []
        self.ids: list[str] = []
        self.links: list[str] = []

    def handle_starttag(self, tag, attributes):
        given = dict(attributes)
        if re.fullmatch("h[1-6]", tag):
            self.headings.append(int(tag[1]))
        if tag == "img" and not given.get("alt"):
            self.nameless.append(str(given))
        if given.get("role") == "img" and not given.get("aria-label"):
            self.nameless.append(str(given))
        self.addresses += [v for k, v in attributes if k in ("src", "href", "action") and v]
        self.ids += [given["id"]] if "id" in given else []
        if tag == "a":
            self.links.append(given.get("href", ""))


def test_the_page_loads_alone_and_can_be_sorted(browser, page, tmp_path):
    probed = tmp_path / "probed.html"
    probed.write_text(with_probe(page.read_text(), PROBE))
    for width in (1280, 390):
        seen = browse(browser, probed, "--dump-dom", f"--window-size={width},900")
        complaints = [line for line in seen.stderr.splitlines() if ":CONSOLE" in line]
        assert not complaints, complaints
        found = re.search(r'<pre id="probe">(.*?)</pre>', seen.stdout, re.S)
        assert found and found[1], seen.stderr[-2000:]
        told = json.loads(found[1].replace("&gt;", ">").replace("&amp;", "&"))
        assert told["loaded"] == [] and told["broken"] == []
        assert told["images"] > 20
        assert told["overflow"] <= 0, "the page is wider than its window"
        assert len(told["up"]) == 3 and told["up"] == sorted(told["up"])
        assert told["down"] == told["up"][::-1]
        gallery = told["gallery"]
        assert {method for method, _ in gallery["first"]} == {"fused"}
        ious = [iou for _, iou in gallery["first"]]
        assert len(ious) == 12 and ious == sorted(ious)
        assert [iou for _, iou in gallery["best"]] == ious[::-1]
        assert len(gallery["all"]) == 24 and len(gallery["wks"]) == 12
        assert gallery["none"] == [] and told["count"] == "0 of 24 shown"


def test_a_program_that_is_not_the_pages_own_does_not_run(browser, page, tmp_path):
    spoiled = tmp_path / "spoiled.html"
    script = "<script>document.title = 'overtaken'</script>"
    style = '<p id="styled" style="color: rgb(1, 2, 3)">x</p>'
    spoiled.write_text(page.read_text().replace("</body>", script + style + "</body>"))
    seen = browse(browser, spoiled, "--dump-dom")
    assert "overtaken</title>" not in seen.stdout and "<title>" in seen.stdout
    refusals = [line for line in seen.stderr.splitlines() if "Content Security Policy" in line]
    assert len(refusals) == 2, seen.stderr


def test_a_screenshot_shows_more_than_white(browser, page, tmp_path):
    picture = tmp_path / "page.png"
    browse(browser, page, f"--screenshot={picture}", "--window-size=1280,900")
    from PIL import Image

    with Image.open(picture) as image:
        colors = image.convert("RGB").getcolors(1 << 24)
    assert colors and len(colors) > 50, "the page is blank"


def test_the_page_reads_well_without_eyes_or_scripts(page):
    outline = Outline()
    text = page.read_text()
    outline.feed(text)
    assert outline.nameless == []
    assert outline.headings[0] == 1 and outline.headings.count(1) == 1
    steps = zip(outline.headings, outline.headings[1:])
    assert all(below <= above + 1 for above, below in steps), outline.headings
    assert all(a.startswith(("data:", "#")) for a in outline.addresses)
    assert {link[1:] for link in outline.links} <= set(outline.ids)
    # The numbers are those of table.md.
    table = (page.parent / "table.md").read_text()
    for number in re.findall(r"^\| fused \|(.*)\|$", table, re.M)[0].split("|"):
        assert f">{number.strip()}<" in text, number
