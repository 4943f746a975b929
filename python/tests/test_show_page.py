"""The page of `semfm-cli show` in a real browser: pointing, layers, keys, a large mesh,
no network."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest
from browser import browse, browser, probe, semfm_cli  # noqa: F401

pytestmark = pytest.mark.full

#: What a 100 000-vertex page may take, in bytes and in milliseconds without a graphics processor:
#: on two slow cores it took 1.5 MB, 180 ms to unpack, 850 ms for the first answer (shaders are
#: compiled, the picture of numbers is drawn) and 0.4 ms for each one after.
LARGE = {"bytes": 4e6, "ready": 10_000, "first": 15_000, "each": 25}

#: Moves the pointer over a panel, at shares of its width and height, and waits for the answer.
HELPERS = """
const groups = await window.semfmReady;
const [source, target] = groups[0];
const mouse = { pointerId: 1, pointerType: "mouse", bubbles: true };
const point = async (panel, x, y) => {
  const box = panel.canvas.getBoundingClientRect();
  const at = { clientX: box.left + x * box.width, clientY: box.top + y * box.height };
  panel.canvas.dispatchEvent(new PointerEvent("pointermove", { ...at, ...mouse }));
  await frame();
  return panel.output.textContent;
};
const leave = async panel => {
  panel.canvas.dispatchEvent(new PointerEvent("pointerleave", mouse));
  await frame();
};
const pixels = ({ canvas }) =>
  canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
// Pixels of a panel's own canvas that are yellow.
const lit = panel => {
  const rgba = pixels(panel);
  let n = 0;
  for (let i = 0; i < rgba.length; i += 4) {
    const [r, g, b] = rgba.subarray(i, i + 3);
    if (r > 100 && g > 0.62 * r && b < 0.4 * r) n++;
  }
  return n;
};
// A place of the object on the middle line, from the left.
const edge = panel => {
  const { clientWidth: width, clientHeight: height } = panel.canvas;
  for (let x = 0.02; x < 1; x += 0.01) if (panel.pick(x * width, height / 2) >= 0) return x + 0.02;
};
await frame(); await frame();
"""


def run(*arguments) -> str:
    done = subprocess.run([semfm_cli(), *arguments], capture_output=True, text=True)
    assert done.returncode in (0, 1), done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def demo(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("show")
    run("demo", "-q", "-o", out)
    run("show", out / "transfer", "-o", out / "page.html")
    return out


def calm(console: list[str]) -> list[str]:
    """What a person would find in the console, without what software drawing and the reading of
    pixels in these tests make the browser say."""
    ours = ("GPU stall", "Multiple readback")
    return [line for line in console if not any(word in line for word in ours)]


def test_pointing_at_either_object_lights_its_counterpart(browser, demo):  # noqa: F811
    body = """
    const told = { before: [lit(source), lit(target)], says: [], lit: [] };
    for (const panel of [source, target]) {
      told.says.push(await point(panel, edge(panel), 0.5));
      told.says.push((panel === source ? target : source).output.textContent);
      told.lit.push([source.nHighlighted(), target.nHighlighted()], [lit(source), lit(target)]);
      await leave(panel);
    }
    told.after = [lit(source), lit(target), source.output.textContent];
    told.n = [source.n, target.n];
    told.gl = source.painter.gl.getError();
    told.loaded = performance.getEntriesByType("resource").map(e => e.name)
      .filter(name => !name.startsWith("data:"));
    return told;
    """
    told, console = probe(browser, demo / "page.html", HELPERS + body)
    assert calm(console) == [] and told["gl"] == 0
    assert told["loaded"] == [], "the page asked the network for something"
    assert told["n"] == [3000, 3000]
    assert told["before"] == [0, 0] == told["after"][:2]
    (by_source, yellow), (by_target, yellow_again) = told["lit"][:2], told["lit"][2:]
    assert min(by_source) > 0 and min(by_target) > 0
    assert max(yellow) > 20 and max(yellow_again) > 20
    assert "vertex" in told["says"][0] and "weight" in told["says"][0]
    assert "matched" in told["says"][1]
    assert "matched to source vertex" in told["says"][2] and "vertex" in told["says"][3]
    assert told["after"][2].startswith("Point at")


def test_layers_switch_with_their_legends(browser, demo):  # noqa: F811
    body = """
    const buttons = [...document.querySelectorAll('.controls button[aria-pressed]')];
    const told = { names: buttons.map(b => b.textContent), legends: [], pictures: [] };
    for (const button of buttons) {
      button.click(); await frame();
      told.legends.push(document.querySelector(".legend").textContent);
      const checksum = (sum, x, i) => (sum * 31 + x * (i % 7 + 1)) % 1000003;
      told.pictures.push(pixels(target).reduce(checksum, 0));
    }
    told.pressed = buttons.map(b => b.getAttribute("aria-pressed"));
    return told;
    """
    told, console = probe(browser, demo / "page.html", HELPERS + body)
    assert calm(console) == []
    assert told["names"][:4] == ["region", "colour transfer", "features", "anchors"]
    legends = dict(zip(told["names"], told["legends"]))
    assert "weight" in legends["region"] and "matched" in legends["colour transfer"]
    assert "anchor 1: cosine " in legends["anchors"]
    assert len(set(told["pictures"])) == len(told["names"]), "two layers look the same"
    assert told["pressed"].count("true") == 1 and told["pressed"][-1] == "true"


def test_keys_turn_both_objects_and_describe_the_middle(browser, demo):  # noqa: F811
    body = """
    const key = async name => {
      source.canvas.dispatchEvent(new KeyboardEvent("keydown", { key: name }));
      await frame();
    };
    source.canvas.focus();
    const told = { focus: document.activeElement === source.canvas, start: [source.yaw, target.yaw] };
    await key("ArrowLeft"); await key("ArrowUp"); await key("+");
    told.turned = [source.yaw, target.yaw]; told.zoom = [source.zoom, target.zoom];
    told.says = source.output.textContent;
    told.cross = source.stage.classList.contains("crosshair");
    document.querySelector("input[type=checkbox]").click();
    await key("ArrowLeft");
    told.alone = [source.yaw, target.yaw];
    document.querySelector(".right button").click();
    told.again = [source.yaw, target.yaw, source.zoom];
    // Two fingers that part make it larger.
    const finger = (kind, pointerId, clientX) => source.canvas.dispatchEvent(
      new PointerEvent(kind, { pointerId, clientX, clientY: 300, pointerType: "touch" }));
    finger("pointerdown", 5, 100); finger("pointerdown", 6, 200);
    finger("pointermove", 6, 300);
    finger("pointerup", 6, 300); finger("pointerup", 5, 100);
    told.pinched = source.zoom;
    return told;
    """
    told, console = probe(browser, demo / "page.html", HELPERS + body)
    assert calm(console) == [] and told["focus"]
    start, turned, alone = (np.array(told[name]) for name in ("start", "turned", "alone"))
    np.testing.assert_allclose(turned - start, [0.1, 0.1])
    assert told["zoom"][0] == told["zoom"][1] > 1
    np.testing.assert_allclose(alone - turned, [0.1, 0], atol=1e-12)
    assert told["says"].startswith("vertex") and told["cross"]
    np.testing.assert_allclose(told["again"], [*start, 1])
    assert told["pinched"] == pytest.approx(2)


def torus(n_around: int, n_across: int, path: Path) -> None:
    """A bent torus, and per-vertex features that say which part of it a vertex belongs to."""
    u, v = np.meshgrid(
        2 * np.pi * np.arange(n_around) / n_around,
        2 * np.pi * np.arange(n_across) / n_across,
        indexing="ij",
    )
    ring = 1 + (0.3 + 0.1 * np.cos(u)) * np.cos(v)
    points = np.stack([ring * np.cos(u), 1.4 * ring * np.sin(u), 0.35 * np.sin(v)], -1)
    index = np.arange(n_around * n_across).reshape(n_around, n_across)
    right, up = np.roll(index, -1, 0), np.roll(index, -1, 1)
    corner = np.roll(right, -1, 1)
    faces = np.concatenate(
        [np.stack([index, right, corner], -1), np.stack([index, corner, up], -1)]
    ).reshape(-1, 3)
    with path.open("w") as out:
        out.writelines(f"v {x:.6f} {y:.6f} {z:.6f}\n" for x, y, z in points.reshape(-1, 3))
        out.writelines(f"f {a} {b} {c}\n" for a, b, c in faces + 1)
    features = np.stack([np.cos(u), np.sin(u), np.cos(2 * u), 0.3 * np.cos(v)], -1)
    np.save(path.with_suffix(".npy"), features.reshape(-1, 4).astype("f4"))


@pytest.fixture(scope="module")
def large(tmp_path_factory) -> Path:
    """A transfer to 101 000 vertices."""
    out = tmp_path_factory.mktemp("large")
    torus(60, 40, out / "small.obj")
    torus(420, 240, out / "large.obj")
    (out / "grip.json").write_text(json.dumps({"vertices": list(range(400))}))
    features = ["--source-features", out / "small.npy", "--target-features", out / "large.npy"]
    meshes = [out / "small.obj", out / "large.obj", "--region", out / "grip.json"]
    run("transfer", *meshes, *features, "--no-cache", "-q", "-o", out / "answer")
    run("show", out / "answer", "-o", out / "page.html")
    return out / "page.html"


def test_a_hundred_thousand_vertices_are_no_burden(browser, large):  # noqa: F811
    body = """
    const [width, height] = [target.canvas.clientWidth, target.canvas.clientHeight];
    const x = edge(target) * width, told = { n: target.n, ready };
    source.ids = target.ids = null;
    let start = performance.now();
    target.point(x, height / 2);
    told.first = performance.now() - start;
    start = performance.now();
    for (let i = 0; i < 100; i++) target.point(x + i % 10, height / 2);
    told.each = (performance.now() - start) / 100;
    start = performance.now();
    for (let i = 0; i < 100; i++) source.hover(i);
    told.back = (performance.now() - start) / 100;
    await frame();
    told.lit = [source.nHighlighted(), target.nHighlighted()];
    return told;
    """
    begun = "const begun = performance.now(); await window.semfmReady;"
    begun += "const ready = performance.now() - begun;"
    told, console = probe(browser, large, begun + HELPERS + body)
    assert calm(console) == []
    assert told["n"] == 420 * 240 and large.stat().st_size < LARGE["bytes"]
    assert told["ready"] < LARGE["ready"] and told["first"] < LARGE["first"]
    assert told["each"] < LARGE["each"] and told["back"] < LARGE["each"], told
    assert min(told["lit"]) > 0


def test_without_webgl_the_page_says_so(browser, demo):  # noqa: F811
    body = """
    await window.semfmReady;
    const buttons = [...document.querySelectorAll('.controls button')];
    buttons.forEach(button => button.click());
    return { said: document.body.innerText };
    """
    told, console = probe(browser, demo / "page.html", body, "--disable-3d-apis")
    assert calm(console) == []
    assert told["said"].count("does not offer WebGL 2") == 3
    assert "accept" in told["said"]


def test_meshes_with_regions_and_views_files_are_shown(browser, demo):  # noqa: F811
    mesh, views = demo / "containers_0_s0.obj", demo / "v.views.mcap"
    run("views", mesh, "-o", views, "--count", "4", "--size", "64", "--renderer", "cpu", "-q")
    region = demo / "containers_0_s0.json"
    run("show", mesh, region, views, "-o", demo / "parts.html", "--title", "Parts")
    body = """
    const all = await window.semfmReady;
    await frame();
    const [[first], [second]] = all;
    const told = {
      titles: [...document.querySelectorAll("h2")].map(h => h.textContent),
      pictures: document.querySelectorAll(".pictures img").length,
      layers: first.layers.length, says: "",
    };
    const box = first.canvas;
    for (let x = 0; x < box.clientWidth && !told.says; x += 5) {
      const vertex = first.pick(x, box.clientHeight / 2);
      if (vertex >= 0) { first.hover(vertex); told.says = first.output.textContent; }
    }
    const before = [second.yaw, second.pitch];
    document.querySelectorAll(".pictures button")[2].click();
    told.turned = Math.hypot(second.yaw - before[0], second.pitch - before[1]);
    told.images = [...document.querySelectorAll(".pictures img")].map(i => i.naturalWidth);
    return told;
    """
    told, console = probe(browser, demo / "parts.html", body)
    assert calm(console) == []
    assert told["titles"] == ["containers_0_s0.obj", "v.views.mcap"]
    assert told["layers"] == 2 and told["says"].startswith("vertex") and "weight" in told["says"]
    assert told["pictures"] == 4 and told["images"] == [64] * 4 and told["turned"] > 0.01


def test_the_hidden_counterpart_is_pointed_at(browser, demo):  # noqa: F811
    body = """
    const ring = target.hiddenPlace, told = { before: ring.hidden };
    document.querySelector("input[type=checkbox]").click(); // the source stays where it is
    const shown = vertex => { source.hover(vertex); return !ring.hidden; };
    const some = [...Array(source.n).keys()].filter(v => v % 25 === 0);
    const front = some.map(shown);
    target.turn(Math.PI, 0); await frame();
    told.moved = ring.hidden;
    const back = some.map(shown);
    told.turned = some.filter((_, i) => !front[i] && back[i]).length;
    told.visible = [front, back].map(all => all.filter(on => !on).length);
    const hidden = some[back.indexOf(true)];
    shown(hidden);
    told.says = ring.textContent;
    const box = ring.getBoundingClientRect(), stage = target.stage.getBoundingClientRect();
    told.inside = box.left >= stage.left && box.right <= stage.right && box.top >= stage.top;
    await leave(source);
    told.after = ring.hidden;
    return told;
    """
    told, console = probe(browser, demo / "page.html", HELPERS + body)
    assert calm(console) == []
    assert told["before"] and told["moved"] and told["after"] and told["inside"]
    assert told["says"] == "on the far side"
    assert told["turned"] > 0 and min(told["visible"]) > 0


def test_hands_step_through_every_grasp(browser, demo):  # noqa: F811
    grasps = json.loads((demo / "transfer" / "grasps.json").read_text())["grasps"]
    body = """
    const [, [panel]] = await window.semfmReady;
    const section = panel.figure.closest("section"), aside = section.querySelector(".grasps");
    section.scrollIntoView(); await frame(); await frame();
    const checksum = () => pixels(panel).reduce((sum, x, i) => (sum * 31 + x * (i % 7 + 1)) % 1000003, 0);
    const [previous, next] = aside.querySelectorAll(".steps button");
    const told = { n: aside.querySelectorAll(".all button").length, titles: [], terms: [], pictures: [], scores: [] };
    for (let i = 0; i < told.n; i++) {
      told.titles.push(aside.querySelector("output").textContent);
      told.terms.push([...aside.querySelectorAll(".terms span")].map(e => e.textContent));
      told.scores.push(Number(aside.querySelector("dd").textContent));
      told.pictures.push(checksum());
      next.click(); await frame();
    }
    told.around = aside.querySelector("output").textContent;
    previous.click(); await frame();
    told.last = aside.querySelector("output").textContent;
    const closed = checksum();
    const [open, together] = aside.querySelectorAll("input");
    open.click(); await frame();
    told.opened = checksum() !== closed; open.click();
    together.click(); await frame();
    told.together = checksum() !== closed;
    told.translucent = pixels(panel).some((alpha, i) => i % 4 === 3 && alpha > 100 && alpha < 200);
    told.gl = panel.painter.gl.getError();
    return told;
    """
    told, console = probe(browser, demo / "page.html", HELPERS + body)
    assert calm(console) == [] and told["gl"] == 0
    n = len(grasps)
    assert told["n"] == n > 2
    titles = [f"grasp {i}, of 0 to {n - 1}" for i in range(n)]
    assert told["titles"] == titles
    assert told["around"] == titles[0] and told["last"] == titles[-1]
    assert told["terms"][0] == sorted(grasps[0]["terms"])
    np.testing.assert_allclose(told["scores"], [g["score"] for g in grasps], atol=6e-4)
    assert len(set(told["pictures"])) > 0.8 * n, "steps show the same picture"
    assert told["opened"] and told["together"] and told["translucent"]


def test_a_grasp_is_shown_over_time_and_as_stills_where_less_motion_is_wanted(browser, demo):  # noqa: F811
    body = """
    const [, [panel]] = await window.semfmReady;
    const section = panel.figure.closest("section"), aside = section.querySelector(".grasps");
    section.scrollIntoView(); await frame(); await frame();
    const checksum = () => pixels(panel).reduce((sum, x, i) => (sum * 31 + x * (i % 7 + 1)) % 1000003, 0);
    const hands = panel.hands, grasp = hands.data.grasps[0], before = checksum();
    const told = { names: [...aside.querySelectorAll(".grasping button")].map(e => e.textContent), pictures: [] };
    told.less = matchMedia("(prefers-reduced-motion: reduce)").matches;
    for (const made of [...aside.querySelectorAll(".grasping button")].slice(-3)) {
      made.click(); await frame(); await frame();
      const place = hands.grasping.place(grasp), at = hands.grasping.poses(grasp);
      told.pictures.push({
        sum: checksum(), lift: Math.hypot(...hands.lift()), contacts: hands.grasping.isTouching,
        behind: Math.hypot(...[3, 7, 11].map(k => place[k] - grasp.place[k])),
        closed: Math.max(...at.flatMap((m, i) => m.map((x, k) => Math.abs(x - grasp.closed[i][k])))),
        pressed: made.getAttribute("aria-pressed"),
      });
    }
    // The object is lifted with the hand: what is under the pointer stays the object.
    const [vertex] = panel.faces, [x, y] = panel.placeOf(vertex);
    hands.grasping.moment = 0;
    told.moved = Math.hypot(panel.placeOf(vertex)[0] - x, panel.placeOf(vertex)[1] - y);
    aside.querySelectorAll(".steps button")[1].click(); await frame();
    aside.querySelectorAll(".steps button")[0].click(); await frame(); await frame();
    told.left = hands.grasping === null && checksum() === before;
    told.gl = panel.painter.gl.getError();
    return told;
    """
    for options, less in ((), False), (("--force-prefers-reduced-motion",), True):
        told, console = probe(browser, demo / "page.html", HELPERS + body, *options)
        assert calm(console) == [] and told["gl"] == 0
        assert told["names"] == ([] if less else ["play"]) + ["comes", "closes", "lifts"] and told["less"] is less
        come, closed, lifted = told["pictures"]
        assert come["behind"] < 1e-9 and come["closed"] > 1e-3 and not come["contacts"]
        assert closed["closed"] < 1e-9 and closed["contacts"] and closed["lift"] == 0
        assert lifted["lift"] > 0 and lifted["pressed"] == "true" and told["moved"] > 5
        assert len({picture["sum"] for picture in told["pictures"]}) == 3
        assert told["left"], "another grasp is shown as it stands"


def test_the_page_can_be_dark_and_prints_what_was_never_scrolled_to(browser, demo):  # noqa: F811
    body = """
    const ground = () => getComputedStyle(document.body).backgroundColor;
    const told = { system: ground() };
    document.getElementById("theme").click(); told.chosen = ground();
    document.getElementById("theme").click(); told.again = ground();
    const [, [panel]] = groups;
    told.blank = pixels(panel).every(x => x === 0) || panel.canvas.width === 300;
    dispatchEvent(new Event("beforeprint"));
    told.printed = pixels(panel).some(x => x > 0);
    told.instructions = document.querySelector("details").open;
    return told;
    """
    told, console = probe(browser, demo / "page.html", HELPERS + body, "--window-size=1280,500")
    assert calm(console) == []
    assert told["system"] != told["chosen"] and told["again"] == told["system"]
    assert told["blank"] and told["printed"] and not told["instructions"]
    dark, _ = probe(
        browser, demo / "page.html", HELPERS + body, "--blink-settings=preferredColorScheme=0"
    )
    assert dark["system"] == told["chosen"]


def test_a_program_that_is_not_the_pages_own_does_not_run(browser, demo):  # noqa: F811
    spoiled = demo / "spoiled.html"
    script = "<script>document.title = 'overtaken'</script>"
    spoiled.write_text((demo / "page.html").read_text().replace("</body>", script + "</body>"))
    seen = browse(browser, spoiled, "--dump-dom")
    assert "overtaken</title>" not in seen.stdout and "<title>SemFM" in seen.stdout
    assert "Content Security Policy" in seen.stderr


def test_what_cannot_be_shown_is_named_with_what_can(demo):
    for path, word in (
        (demo / "containers_0_s0.emb.mcap", "show their views file"),
        (demo / "transfer" / "transfer.mcap", "show the folder"),
        (demo / "transfer" / "grasps.json", "semfm.grasps/1"),
        (demo / "containers_0_s0.json", "without a mesh before it"),
    ):
        done = subprocess.run(
            [semfm_cli(), "show", path, "-o", demo / "no.html"], capture_output=True, text=True
        )
        assert done.returncode == 2 and word in done.stderr, done.stderr
        assert "transfer -o" in done.stderr and not (demo / "no.html").exists()
