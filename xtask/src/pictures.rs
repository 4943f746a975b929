//! `cargo xtask pictures`: the README's pictures, made by our own commands from our own objects.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use image::ImageReader;
use image::codecs::jpeg::JpegEncoder;

use crate::process::{cargo, program};
use crate::workspace::Workspace;

/// Where they lie.
const FOLDER: &str = "docs/pictures";
/// Bytes that one of them, and all together, may have.
pub const EACH: u64 = 200_000;
pub const TOGETHER: u64 = 700_000;
/// Letters stay sharp from here on.
const QUALITY: u8 = 88;

const BROWSERS: [&str; 4] =
    ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];

/// Put into a copy of the page: points at the place of the target's region of which most is to be seen
/// on both objects.
const POINT: &str = r#"<script>
addEventListener("load", async () => {
  const [[source, target]] = await window.semfmReady;
  const visible = panel => {
    const found = new Set(), { clientWidth: width, clientHeight: height } = panel.canvas;
    for (let y = 0; y < height; y += 4) for (let x = 0; x < width; x += 4) found.add(panel.pick(x, y));
    return found.delete(-1), found;
  };
  setTimeout(() => {
    const on_source = visible(source);
    let best = null, most = 0;
    for (const vertex of visible(target)) {
      if (!/weight (1.00|0.9)/.test(target.describe(vertex))) continue;
      target.hover(vertex);
      const matched = Number(/source vertex (\d+)/.exec(target.output.textContent)[1]);
      const lit = Math.min(source.nHighlighted(), target.nHighlighted());
      if (on_source.has(matched) && lit > most) [best, most] = [vertex, lit];
    }
    if (best !== null) target.hover(best);
  }, 1000);
});
</script></body>"#;

/// Makes all of them anew; the page's only where there is a browser.
pub fn make(workspace: &Workspace) -> Result<()> {
    cargo(workspace, &["build", "--workspace", "--bins"]).succeed()?;
    let made = workspace.built("semfm-pictures");
    let at = |name: &str| made.join(name);
    let semfm = |arguments: &[&str]| {
        program(workspace, &workspace.built("debug/semfm-cli"), arguments).output().map(|_| ())
    };
    let text = |path: PathBuf| path.to_str().map(str::to_owned).context("a path is not UTF-8");
    let (demo, sheet) = (text(made.clone())?, text(at("views.png"))?);
    let (object, views) = (text(at("containers_0_s0.obj"))?, text(at("source.views.mcap"))?);
    let (transfer, page) = (text(at("transfer"))?, text(at("page.html"))?);
    semfm(&["demo", "-q", "--category", "containers", "--seed", "0", "-o", &demo])?;
    semfm(&[
        "views",
        &object,
        "-q",
        "-o",
        &views,
        "--renderer",
        "cpu",
        "--count",
        "12",
        "--sheet",
        &sheet,
    ])?;
    semfm(&["show", &transfer, "-q", "-o", &page, "--title", "From a mug to a kettle"])?;

    for name in ["transfer", "features", "grasps"] {
        keep(workspace, &at(&format!("transfer/{name}.png")), name)?;
    }
    keep(workspace, &at("plan/motion.png"), "motion")?;
    keep(workspace, &at("views.png"), "views")?;
    match photograph(workspace, &made)? {
        Some(picture) => keep(workspace, &picture, "page")?,
        None => println!("{FOLDER}/page.jpg stays as it is: no browser ({})", BROWSERS.join(", ")),
    }
    check(workspace)
}

/// A picture of the page in a browser, if there is one.
fn photograph(workspace: &Workspace, made: &Path) -> Result<Option<PathBuf>> {
    let runs = |name: &&&str| program(workspace, Path::new(name), &["--version"]).works();
    let Some(browser) = BROWSERS.iter().find(runs) else { return Ok(None) };
    let (page, picture) = (made.join("pointed.html"), made.join("page.png"));
    let html = std::fs::read_to_string(made.join("page.html"))?;
    // The page's policy runs no program but its own; this copy is ours alone.
    let html = html.replace("http-equiv=\"Content-Security-Policy\"", "name=\"policy\"");
    std::fs::write(&page, html.replace("</body>", POINT))?;
    let profile = format!("--user-data-dir={}", made.join("profile").display());
    let shot = format!("--screenshot={}", picture.display());
    let url = format!("file://{}", page.display());
    let arguments = [
        "--headless=new",
        "--no-sandbox",
        "--use-angle=swiftshader",
        "--enable-unsafe-swiftshader",
        "--disable-background-networking",
        "--disable-component-update",
        "--hide-scrollbars",
        "--virtual-time-budget=15000",
        "--window-size=1280,850",
        &profile,
        &shot,
        &url,
    ];
    if !program(workspace, Path::new(browser), &arguments).works() {
        bail!("{browser} took no picture of {}", page.display());
    }
    Ok(Some(picture))
}

/// Puts a PNG into the repository as JPEG: a third of the bytes.
fn keep(workspace: &Workspace, png: &Path, name: &str) -> Result<()> {
    let place = || png.display().to_string();
    let picture = ImageReader::open(png).with_context(place)?.decode().with_context(place)?;
    let mut jpeg = Vec::new();
    JpegEncoder::new_with_quality(&mut jpeg, QUALITY).encode_image(&picture.into_rgb8())?;
    let path = workspace.root.join(FOLDER).join(format!("{name}.jpg"));
    std::fs::create_dir_all(workspace.root.join(FOLDER))?;
    std::fs::write(&path, &jpeg).with_context(|| path.display().to_string())?;
    println!("{FOLDER}/{name}.jpg: {} kB", jpeg.len() / 1000);
    Ok(())
}

/// Refuses pictures that would make the repository heavy.
pub fn check(workspace: &Workspace) -> Result<()> {
    let mut together = 0;
    for entry in workspace.root.join(FOLDER).read_dir()? {
        let entry = entry?;
        let bytes = entry.metadata()?.len();
        together += bytes;
        if bytes > EACH {
            bail!("{}: expected at most {EACH} bytes, found {bytes}", entry.path().display());
        }
    }
    if together > TOGETHER {
        bail!("{FOLDER}: expected at most {TOGETHER} bytes together, found {together}");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_small_and_those_that_the_readme_shows_are_there() {
        let workspace = Workspace::find().unwrap();
        check(&workspace).unwrap();
        let readme = std::fs::read_to_string(workspace.root.join("README.md")).unwrap();
        let shown: Vec<&str> =
            readme.split(FOLDER).skip(1).filter_map(|rest| rest.split(['"', ')']).next()).collect();
        assert!(!shown.is_empty());
        for name in shown {
            assert!(workspace.root.join(format!("{FOLDER}{name}")).is_file(), "{FOLDER}{name}");
        }
    }
}
