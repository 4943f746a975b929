//! Whether a depth image lies on the pixels of the colour picture that its masks were drawn in.
//!
//! Depth is often registered to the colour when it is recorded, and then published with the intrinsics of the depth
//! camera all the same. Every point is then off by as much as the two cameras differ, some 2 cm at arm's length, and
//! nothing looks wrong. The outline of a mask tells: where an object stands before something farther away, depth jumps,
//! and it jumps on the outline under the camera that is right.

use semfm_align::DepthImage;
use semfm_geom::Pinhole;
use semfm_geom::math::DAffine3;

use crate::{Error, Result};

/// Which camera the pixels of a depth image belong to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum DepthGrid {
    /// The colour camera: the depth was registered, and the colour's intrinsics are its own.
    Color,
    /// The depth camera itself: the depth must be registered before a mask of the colour fits.
    Depth,
    /// The outline does not tell.
    Undecided,
}

/// How well depth and mask lie on each other under either camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegistrationCheck {
    /// Mean distance of the mask's outline from the nearest jump of depth, in pixels (at most 8), if the depth image lies on
    /// the colour's pixels.
    pub color_pixels: f64,
    /// The same if it lies on the depth camera's.
    pub depth_pixels: f64,
    /// Which it is.
    pub grid: DepthGrid,
}

/// Depth jumps where the nearest return beside a pixel is farther away by this share of its depth.
const JUMP: f64 = 0.04;
/// Between the returns of an object and of what is behind it lies the shadow of the projector.
const WIDEST_SHADOW: usize = 16;
/// Outlines without a jump nearby (an object on a table) say nothing; this is as far as one is looked for.
const FARTHEST: f64 = 8.0;
/// The better camera's distance must be this share of the other's. Above 0.9, a hand in front of the object decides by
/// its own edges; below 0.7, a baseline of 1.5 cm at 1 m is not told.
const DECISIVE: f64 = 0.85;
/// Fewer pixels are no outline.
const LEAST_OUTLINE: usize = 30;

/// Holds the jumps of a depth image against the outline of a mask in the colour picture, once as if the depth lay on the
/// colour camera's pixels, and once as if it lay on the depth camera's, which stands as `color_from_depth` says (the
/// identity where nobody measured it).
///
/// # Errors
/// [`Error::Invalid`] for sizes that differ, and for an outline of fewer than 30 pixels.
pub fn check_registration(
    depth: &DepthImage,
    marked: &[bool],
    color_camera: &Pinhole,
    depth_camera: &Pinhole,
    color_from_depth: DAffine3,
) -> Result<RegistrationCheck> {
    let (width, height) = (color_camera.width() as usize, color_camera.height() as usize);
    let same_size = [depth.width(), depth.height()] == [width, height];
    if !same_size || marked.len() != width * height {
        let expected = format!("depth and mask of {width} × {height} pixels, as the colour camera");
        let found =
            format!("{} × {}, and {} of the mask", depth.width(), depth.height(), marked.len());
        return Err(Error::invalid("registration", expected, found));
    }
    let outline = outline_of(marked, width, height);
    if outline.len() < LEAST_OUTLINE {
        let expected = format!("an outline of at least {LEAST_OUTLINE} pixels");
        return Err(Error::invalid("mask", expected, outline.len()));
    }
    let jumps = jumps_of(depth);
    let as_it_lies: Vec<[f64; 2]> =
        jumps.iter().map(|&(column, row, _)| centre(column, row)).collect();
    let own = depth_camera.posed(DAffine3::IDENTITY)?;
    let color = color_camera.posed(color_from_depth)?;
    let carried: Vec<[f64; 2]> = jumps
        .iter()
        .filter_map(|&(column, row, z)| {
            let [u, v] = centre(column, row);
            let seen = color.project(own.unproject(semfm_geom::PixelDepth { u, v, z }));
            (seen.z > 0.0).then_some([seen.u, seen.v])
        })
        .collect();
    let color_pixels = mean_distance(&outline, &as_it_lies, width, height);
    let depth_pixels = mean_distance(&outline, &carried, width, height);
    let grid = if color_pixels < DECISIVE * depth_pixels {
        DepthGrid::Color
    } else if depth_pixels < DECISIVE * color_pixels {
        DepthGrid::Depth
    } else {
        DepthGrid::Undecided
    };
    Ok(RegistrationCheck { color_pixels, depth_pixels, grid })
}

/// An outline that is this far from the jumps of depth on average, of at most 8 pixels, belongs to another picture. On the
/// four objects of one DexYCB frame it is 3.4 to 4.7 where depth and mask belong together (an object on a table has no jump
/// where it stands) and 6.3 to 6.7 where they are 20 pixels apart.
const FAR_OFF: f64 = 6.0;

/// What speaks against depth under a mask with the intrinsics of `camera`, in words with what to do; `None` where nothing
/// does. `color_camera` is the camera of the picture in which the mask was drawn, where that is another
/// ([`check_registration`], both cameras in one place). Without it the outline of the mask is held against the depth alone. An
/// outline that is too short to tell says nothing.
pub fn registration_doubt(
    depth: &DepthImage,
    marked: &[bool],
    camera: &Pinhole,
    color_camera: Option<&Pinhole>,
) -> Option<String> {
    let other = color_camera.filter(|color| color.intrinsics() != camera.intrinsics());
    let color = other.unwrap_or(camera);
    let found = check_registration(depth, marked, color, camera, DAffine3::IDENTITY).ok()?;
    let RegistrationCheck { color_pixels, depth_pixels, grid } = found;
    if other.is_none() {
        return (color_pixels > FAR_OFF).then(|| {
            format!(
                "depth does not jump where the mask ends ({color_pixels:.1} pixels away on average): was the mask drawn in \
                 this picture, and is the depth registered to it?"
            )
        });
    }
    let distances = format!(
        "its jumps are {color_pixels:.1} pixels from the mask's outline there, {depth_pixels:.1} by the other intrinsics"
    );
    Some(match grid {
        DepthGrid::Color => format!(
            "the depth lies on the pixels of the colour picture ({distances}): with the colour's intrinsics every point moves \
             by some {:.0} mm, to where it is",
            1e3 * mean_shift(depth, marked, camera, color)
        ),
        DepthGrid::Depth => format!(
            "the depth lies on the depth camera's pixels ({distances}): register it to the colour picture, or draw the mask \
             in the depth image"
        ),
        DepthGrid::Undecided => {
            format!("the outline does not tell whose pixels the depth lies on ({distances})")
        }
    })
}

/// How far the points under a mask are apart by two cameras, metres.
fn mean_shift(depth: &DepthImage, marked: &[bool], a: &Pinhole, b: &Pinhole) -> f64 {
    let (mut sum, mut n) = (0.0, 0);
    for (pixel, &z) in depth.metres().iter().enumerate().filter(|(i, z)| marked[*i] && **z > 0.0) {
        let [u, v] = centre(pixel % depth.width(), pixel / depth.width());
        sum += f64::from(z) * a.ray_in_camera(u, v).distance(b.ray_in_camera(u, v));
        n += 1;
    }
    if n > 0 { sum / f64::from(n) } else { 0.0 }
}

fn centre(column: usize, row: usize) -> [f64; 2] {
    [column as f64 + 0.5, row as f64 + 0.5]
}

/// Marked pixels beside unmarked ones.
fn outline_of(marked: &[bool], width: usize, height: usize) -> Vec<[f64; 2]> {
    let mut outline = Vec::new();
    for row in 1..height.saturating_sub(1) {
        for column in 1..width.saturating_sub(1) {
            let at = row * width + column;
            let beside = [at - 1, at + 1, at - width, at + width];
            if marked[at] && beside.iter().any(|&other| !marked[other]) {
                outline.push(centre(column, row));
            }
        }
    }
    outline
}

/// Pixels of something before something farther away, with their depth.
fn jumps_of(depth: &DepthImage) -> Vec<(usize, usize, f64)> {
    let mut jumps = Vec::new();
    for row in 0..depth.height() {
        for column in 0..depth.width() {
            let Some(z) = depth.at(column, row) else { continue };
            let next = |step: &dyn Fn(usize) -> Option<(usize, usize)>| {
                (1..=WIDEST_SHADOW).map_while(step).find_map(|(c, r)| depth.at(c, r))
            };
            let around = [
                next(&|i| Some((column.checked_sub(i)?, row))),
                next(&|i| Some((column + i, row)).filter(|(c, _)| *c < depth.width())),
                next(&|i| Some((column, row.checked_sub(i)?))),
                next(&|i| Some((column, row + i)).filter(|(_, r)| *r < depth.height())),
            ];
            let is_farther = |other: &f32| f64::from(other - z) > JUMP * f64::from(z);
            if around.iter().flatten().any(is_farther) {
                jumps.push((column, row, z.into()));
            }
        }
    }
    jumps
}

/// Mean distance of points from the nearest of others, each at most [`FARTHEST`].
fn mean_distance(from: &[[f64; 2]], to: &[[f64; 2]], width: usize, height: usize) -> f64 {
    let reach = FARTHEST.ceil() as isize;
    let mut cells: Vec<Vec<[f64; 2]>> = vec![Vec::new(); width * height];
    for &[u, v] in to {
        if u >= 0.0 && v >= 0.0 && u < width as f64 && v < height as f64 {
            cells[v as usize * width + u as usize].push([u, v]);
        }
    }
    let nearest = |&[u, v]: &[f64; 2]| {
        let mut least = FARTHEST;
        for row in (v as isize - reach).max(0)..(v as isize + reach + 1).min(height as isize) {
            for column in (u as isize - reach).max(0)..(u as isize + reach + 1).min(width as isize)
            {
                for [x, y] in &cells[row as usize * width + column as usize] {
                    least = least.min((x - u).hypot(y - v));
                }
            }
        }
        least
    };
    from.iter().map(nearest).sum::<f64>() / from.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_geom::Intrinsics;

    const WIDTH: usize = 160;
    const HEIGHT: usize = 120;

    fn camera(focal: f64, cx: f64) -> Pinhole {
        let (width, height) = (WIDTH as u32, HEIGHT as u32);
        let intrinsics = Intrinsics { width, height, fx: focal, fy: focal, cx, cy: 60.0 };
        Pinhole::with_pixel_centres_at_half(intrinsics, DAffine3::IDENTITY).unwrap()
    }

    /// A disc of 0.1 m at 0.6 m before a wall at 1 m, as a camera sees it: depth, and where the disc is.
    fn disc(camera: &Pinhole) -> (DepthImage, Vec<bool>) {
        let is_disc = |i: usize| {
            let [u, v] = centre(i % WIDTH, i / WIDTH);
            let ray = 0.6 * camera.ray_in_camera(u, v);
            (ray.x - 0.05).hypot(ray.y) < 0.1
        };
        let marked: Vec<bool> = (0..WIDTH * HEIGHT).map(is_disc).collect();
        let depth = marked.iter().map(|&m| if m { 0.6 } else { 1.0 }).collect();
        (DepthImage::new(WIDTH, HEIGHT, depth).unwrap(), marked)
    }

    #[test]
    fn the_outline_tells_which_camera_the_depth_belongs_to() {
        let (color, own) = (camera(150.0, 80.0), camera(140.0, 86.0));
        let (registered, mask) = disc(&color);
        let (unregistered, _) = disc(&own);
        let check = |depth: &DepthImage| {
            check_registration(depth, &mask, &color, &own, DAffine3::IDENTITY).unwrap()
        };
        let found = check(&registered);
        assert_eq!((found.grid, found.color_pixels), (DepthGrid::Color, 0.0));
        let found = check(&unregistered);
        assert_eq!(found.grid, DepthGrid::Depth);
        assert!(found.depth_pixels < 1.0 && found.color_pixels > 3.0, "{found:?}");
        let flat = DepthImage::new(WIDTH, HEIGHT, vec![1.0; WIDTH * HEIGHT]).unwrap();
        assert_eq!(check(&flat).grid, DepthGrid::Undecided);
        let dot: Vec<bool> = (0..WIDTH * HEIGHT).map(|i| i == 5000).collect();
        let said = |depth: &DepthImage, camera: &Pinhole, color: Option<&Pinhole>| {
            registration_doubt(depth, &mask, camera, color).unwrap_or_default()
        };
        assert!(said(&registered, &own, Some(&color)).contains("colour's intrinsics every point"));
        assert!(said(&unregistered, &own, Some(&color)).contains("register it"));
        assert!(said(&flat, &own, Some(&color)).contains("does not tell"));
        assert_eq!(said(&registered, &color, None), "");
        assert!(said(&flat, &color, None).contains("does not jump"));
        let refused = check_registration(&registered, &dot, &color, &own, DAffine3::IDENTITY);
        assert!(refused.unwrap_err().to_string().contains("outline"));
    }

    #[cfg(feature = "mcap")]
    #[test]
    fn a_camera_info_that_is_not_that_of_the_depth_is_told() {
        use crate::{BagSettings, Observation, read_bag, write_bag};
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("seen.mcap");
        let (color, own) = (camera(150.0, 80.0), camera(140.0, 86.0));
        let (registered, mask) = disc(&color);
        // Depth on the colour's pixels, recorded with the CameraInfo of one camera or of the other.
        let doubt = |info: &Pinhole| {
            let mut seen = Observation::new(*info).with_depth(registered.clone()).unwrap();
            seen.time_nanos = Some(1_000_000_000);
            write_bag(&path, &[seen]).unwrap();
            let mut read = Vec::new();
            let keep = |seen| {
                read.push(seen);
                Ok(())
            };
            read_bag(&path, &BagSettings::default(), keep).unwrap();
            registration_doubt(read[0].depth().unwrap(), &mask, read[0].camera(), Some(&color))
        };
        assert_eq!(doubt(&color), None);
        assert!(doubt(&own).unwrap().contains("colour's intrinsics every point"));
    }
}
