//! A picture of every kind of object: grey with its grip region in orange, then coloured by part.
//!
//! ```sh
//! cargo run -p semfm-synth --example gallery -- gallery.png
//! ```

use std::error::Error;

use semfm_geom::math::DVec3;
use semfm_geom::{Task, principal_axes};
use semfm_synth::{Category, ObjectSettings, SynthObject, make_object};
use semfm_views::camera_towards;
use semfm_views::{RenderSettings, RigSettings, SurfaceColor, render};

const KINDS: usize = 6;
const SIDE: u32 = 200;
const GREY: [f32; 3] = [0.72; 3];
const ORANGE: [f32; 3] = [0.95, 0.5, 0.1];
const PALETTE: [[f32; 3]; 6] = [
    [0.35, 0.65, 0.85],
    [0.9, 0.6, 0.1],
    [0.2, 0.65, 0.5],
    [0.85, 0.4, 0.2],
    [0.8, 0.5, 0.7],
    [0.9, 0.85, 0.3],
];

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "gallery.png".into());
    let seed = std::env::args().nth(2).map_or(Ok(0), |text| text.parse())?;
    // Two pictures an object side by side, a row for each category.
    let mut sheet =
        image::RgbImage::new(2 * KINDS as u32 * SIDE, Category::ALL.len() as u32 * SIDE);
    for (row, category) in (0u32..).zip(Category::ALL) {
        for instance in 0..KINDS {
            let settings = ObjectSettings { seed, ..ObjectSettings::default() };
            let object = make_object(category, instance, &settings)?;
            let region =
                object.region.iter().map(|&grip| if grip { ORANGE } else { GREY }).collect();
            let parts = object.parts.iter().map(|&part| PALETTE[usize::from(part)]).collect();
            for (k, colours) in [region, parts].into_iter().enumerate() {
                let column = (2 * instance + k) as u32;
                let picture = picture(&object, colours)?;
                image::imageops::replace(
                    &mut sheet,
                    &picture,
                    i64::from(column * SIDE),
                    i64::from(row * SIDE),
                );
            }
        }
    }
    sheet.save(&path)?;
    Ok(())
}

/// The object broadside from above, with a colour for each vertex.
fn picture(
    object: &SynthObject,
    colours: Vec<[f32; 3]>,
) -> Result<image::RgbImage, Box<dyn Error>> {
    let rig = RigSettings { size: SIDE, ..RigSettings::default() };
    let longest = principal_axes(&object.mesh)?.row(2);
    let seen_from = longest.cross(DVec3::Z).normalize() + 0.3 * longest + 0.7 * DVec3::Z;
    let camera = camera_towards(&object.mesh, seen_from, DVec3::Z, &rig)?;
    let paint = SurfaceColor::Vertices(&colours);
    let views =
        render(&object.mesh, &paint, &[camera], &RenderSettings::default(), &Task::default())?;
    let pixels = views.into_iter().next().map(|view| view.rgb).ok_or("no view")?;
    Ok(image::RgbImage::from_raw(SIDE, SIDE, pixels).ok_or("picture of another size")?)
}
