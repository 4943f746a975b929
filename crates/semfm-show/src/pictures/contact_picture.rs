//! What a hand touches: the object in the colours of its region, and the hand over it as if of tinted glass.

use semfm::geom::{Mesh, Task};
use semfm::views::View;

use super::painted::Painted;
use super::rgb_picture::RgbPicture;
use super::sheet::PICTURE_SIDE;
use super::viewpoints::viewpoints;
use super::{OPACITY, WeightedMesh};
use crate::Result;
use crate::surface::Surface;

/// The colour of the demonstrator's hand: told from every colour of a region.
pub(crate) const DEMONSTRATOR: [f32; 3] = [0.34, 0.71, 0.91];
/// Outlines, without which fingers run into each other.
const EDGES: f64 = 0.45;

/// The region on an object from two sides, with the hand that touched it where it is a surface; both in one frame and
/// unit.
///
/// # Errors
/// [`Error::Semfm`](crate::Error::Semfm) where rendering fails, and where the task was cancelled.
pub fn contact_picture(
    object: &Mesh,
    weights: &[f64],
    hand: Option<&Mesh>,
    task: &Task,
) -> Result<RgbPicture> {
    let solid = Painted::object(WeightedMesh { mesh: object, weights });
    let cameras = viewpoints(object, weights, PICTURE_SIDE, task)?;
    let mut views = Vec::new();
    for camera in [cameras.best, cameras.other] {
        let under = solid.rendered(camera, 0.0, task)?;
        let Some(hand) = hand else {
            views.push(under);
            continue;
        };
        let mut with_hand = solid.clone();
        let surface = Surface { vertices: hand.vertices().to_vec(), faces: hand.faces().to_vec() };
        with_hand.add(&surface, DEMONSTRATOR);
        let over = with_hand.rendered(camera, EDGES, task)?;
        views.push(glazed(under, &over, object.n_faces()));
    }
    Ok(RgbPicture::beside(&views))
}

/// A view with another over it wherever that shows none of the first `n_solid` triangles.
fn glazed(under: View, over: &View, n_solid: usize) -> View {
    let mut view = under;
    let pixels = view.rgb.as_chunks_mut::<3>().0.iter_mut().zip(over.rgb.as_chunks::<3>().0);
    for ((under, over), &triangle) in pixels.zip(&over.triangles) {
        if usize::try_from(triangle).is_ok_and(|face| face >= n_solid) {
            for (under, over) in under.iter_mut().zip(over) {
                let (below, above) = (f32::from(*under), f32::from(*over));
                *under = (below + OPACITY * (above - below)).round() as u8;
            }
        }
    }
    view
}

#[cfg(test)]
mod tests {
    use semfm::geom::math::DVec3;
    use semfm_geom::zoo::icosphere;

    use super::*;

    #[test]
    fn the_hand_is_blue_over_the_object() {
        let ball = icosphere(3);
        let weights: Vec<f64> = ball.vertices().iter().map(|p| f64::from(p.x > 0.7)).collect();
        let moved = ball.vertices().iter().map(|p| DVec3::X * 1.4 + 0.5 * *p).collect();
        let hand = Mesh::new(moved, ball.faces().to_vec()).unwrap();
        let n_blue = |hand: Option<&Mesh>| {
            let picture = contact_picture(&ball, &weights, hand, &Task::default()).unwrap();
            assert_eq!((picture.width, picture.height), (2 * PICTURE_SIDE, PICTURE_SIDE));
            let pixels = picture.rgb.chunks_exact(3);
            pixels.filter(|rgb| rgb[2] > rgb[0].saturating_add(20)).count()
        };
        assert_eq!(n_blue(None), 0);
        assert!(n_blue(Some(&hand)) > 500);
    }
}
