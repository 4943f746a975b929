//! Small objects that the unit tests share.

use std::collections::BTreeMap;

use semfm_geom::math::DVec3;
use semfm_geom::{Mesh, SemanticCloud, Shape, ShapeSettings, Task};

/// A lumpy, elongated closed surface (258 vertices) without any symmetry: an octahedron cut three
/// times, put on a sphere and pulled about. `stretch` lengthens it along x.
pub(crate) fn blob(stretch: f64) -> Mesh {
    let mut vertices = vec![DVec3::X, -DVec3::X, DVec3::Y, -DVec3::Y, DVec3::Z, -DVec3::Z];
    let mut faces: Vec<[u32; 3]> = vec![
        [0, 2, 4],
        [2, 1, 4],
        [1, 3, 4],
        [3, 0, 4],
        [2, 0, 5],
        [1, 2, 5],
        [3, 1, 5],
        [0, 3, 5],
    ];
    for _ in 0..3 {
        let mut middles = BTreeMap::new();
        let cut = faces.iter().flat_map(|&[a, b, c]| {
            let [ab, bc, ca] =
                [[a, b], [b, c], [c, a]].map(|edge| middle(edge, &mut middles, &mut vertices));
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        });
        faces = cut.collect();
    }
    for p in &mut vertices {
        let swell =
            1.0 + 0.25 * (2.0 * p.x + 1.0).sin() + 0.2 * (3.0 * p.y - p.z).cos() + 0.15 * p.z * p.x;
        *p = DVec3::new(p.x * 1.8 * stretch, p.y, p.z * 0.8) * swell;
    }
    Mesh::new(vertices, faces).unwrap()
}

/// The vertex in the middle of an edge, put on the sphere when first asked for.
fn middle(
    [a, b]: [u32; 2],
    middles: &mut BTreeMap<[u32; 2], u32>,
    vertices: &mut Vec<DVec3>,
) -> u32 {
    *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
        vertices.push((vertices[a as usize] + vertices[b as usize]).normalize());
        vertices.len() as u32 - 1
    })
}

pub(crate) fn shape(mesh: &Mesh, k: usize) -> Shape {
    Shape::new(mesh.clone(), &ShapeSettings { k, ..ShapeSettings::default() }, &Task::default())
        .unwrap()
}

/// A cloud of every third vertex. Its features say where along x the point is (three soft
/// parts) plus an offset that the whole object shares and a little noise.
pub(crate) fn cloud(mesh: &Mesh, stretch: f64, offset: f32) -> SemanticCloud {
    let points: Vec<DVec3> = mesh.vertices().iter().step_by(3).copied().collect();
    let features = points.iter().enumerate().flat_map(|(i, p)| {
        let [first, middle, last] =
            [-1.5, 0.0, 1.5].map(|centre| (-((p.x / stretch - centre) / 0.8).powi(2)).exp() as f32);
        let noise: [f32; 4] = std::array::from_fn(|c| 0.03 * ((i * 31 + c * 17) as f32).sin());
        [first + noise[0], middle + noise[1], last + noise[2], offset, noise[3]]
    });
    let n = points.len();
    SemanticCloud::new(points.clone(), features.collect(), 5, vec![1; n]).unwrap()
}
