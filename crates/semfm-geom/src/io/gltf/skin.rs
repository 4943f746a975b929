//! Skins: vertices that follow joints (glTF 2.0, section 3.7.3).

use super::accessor::{Accessors, Component};
use super::json::{Node, Primitive, Whole};
use crate::Result;
use crate::math::{DAffine3, DMat4, DVec3};

/// A skin as its joints stand in the scene.
pub(super) struct PosedSkin {
    /// For each joint, `scene_from_joint · joint_from_mesh`: the second is the inverse bind matrix.
    scene_from_mesh: Vec<DAffine3>,
}

impl PosedSkin {
    /// Skin number `skin` where the file's nodes stand as `scene_from_node` says (`None` for a node in a ring).
    pub fn new(
        accessors: &Accessors<'_>,
        skin: usize,
        scene_from_node: &[Option<DAffine3>],
    ) -> Result<Self> {
        let (input, skins) = (accessors.input, &accessors.root.skins);
        let place = format!("skin {skin}");
        let Some(json) = skins.get(skin) else {
            return Err(input.error(
                place,
                "a skin that exists",
                format!("{} of them", skins.len()),
            ));
        };
        let n_joints = json.joints.len();
        let binds = match json.inverse_bind_matrices {
            None => vec![DMat4::IDENTITY; n_joints],
            Some(Whole(accessor)) => accessors.matrices(accessor)?,
        };
        if binds.len() < n_joints {
            let found = format!("{} for {n_joints} joints", binds.len());
            return Err(input.error(place, "an inverse bind matrix for each joint", found));
        }
        let posed = json.joints.iter().zip(binds).map(|(&Whole(joint), bind)| {
            let scene_from_joint = scene_from_node.get(joint).copied().flatten();
            scene_from_joint.map(|pose| pose * DAffine3::from_mat4(bind)).ok_or_else(|| {
                input.error(&place, "joints that are nodes", format!("joint {joint}"))
            })
        });
        Ok(Self { scene_from_mesh: posed.collect::<Result<_>>()? })
    }

    /// For each vertex of a primitive, where its joints carry it; `None` for a primitive without joints and weights.
    ///
    /// > x = Σⱼ wⱼ · scene_from_jointⱼ · joint_from_meshⱼ · p, weights divided by their sum
    pub fn of_vertices(
        &self,
        accessors: &Accessors<'_>,
        place: &str,
        primitive: &Primitive,
        n_vertices: usize,
    ) -> Result<Option<Vec<DAffine3>>> {
        let input = accessors.input;
        let mut sums = vec![Blend::default(); n_vertices];
        let mut n_sets = 0;
        loop {
            let name = |what: &str| format!("{what}_{n_sets}");
            let [joints, weights] =
                ["JOINTS", "WEIGHTS"].map(|w| primitive.attributes.get(&name(w)));
            let (Some(&Whole(joints)), Some(&Whole(weights))) = (joints, weights) else { break };
            for accessor in [joints, weights] {
                let count = accessors.get(accessor)?.count.0;
                if count != n_vertices {
                    let expected = format!("{n_vertices} joints and weights");
                    return Err(input.error(place, expected, count.to_string()));
                }
            }
            let joints = accessors.vectors::<4>(joints, &[Component::U8, Component::U16])?;
            let allowed = [Component::F32, Component::U8, Component::U16];
            let weights = accessors.vectors::<4>(weights, &allowed)?;
            for ((sum, joints), weights) in sums.iter_mut().zip(joints).zip(weights) {
                for (joint, weight) in joints.into_iter().zip(weights).filter(|(_, w)| *w > 0.0) {
                    let Some(pose) = self.scene_from_mesh.get(joint as usize) else {
                        let expected = format!("joints below {}", self.scene_from_mesh.len());
                        return Err(input.error(place, expected, joint.to_string()));
                    };
                    sum.add(pose, weight);
                }
            }
            n_sets += 1;
        }
        let first = self.scene_from_mesh.first().copied().unwrap_or(DAffine3::IDENTITY);
        Ok((n_sets > 0).then(|| sums.into_iter().map(|sum| sum.mean().unwrap_or(first)).collect()))
    }
}

/// A weighted sum of transforms.
#[derive(Clone)]
struct Blend {
    columns: [DVec3; 4],
    weight: f64,
}

impl Default for Blend {
    fn default() -> Self {
        Self { columns: [DVec3::ZERO; 4], weight: 0.0 }
    }
}

impl Blend {
    fn add(&mut self, pose: &DAffine3, weight: f64) {
        let matrix = pose.matrix3;
        let columns = [matrix.x_axis, matrix.y_axis, matrix.z_axis, pose.translation];
        for (sum, column) in self.columns.iter_mut().zip(columns) {
            *sum += weight * column;
        }
        self.weight += weight;
    }

    fn mean(self) -> Option<DAffine3> {
        let [x, y, z, w] = self.columns.map(|column| column / self.weight);
        (self.weight > 0.0).then(|| DAffine3::from_cols(x, y, z, w))
    }
}

/// Where every node of the file stands, in whatever scene; `None` for nodes in a ring or below one.
pub(super) fn scene_from_nodes(
    nodes: &[Node],
    roots: &[Whole],
    transform: impl Fn(usize, &Node) -> Result<DAffine3>,
) -> Result<Vec<Option<DAffine3>>> {
    let mut found = vec![None; nodes.len()];
    let mut stack: Vec<(usize, DAffine3)> =
        roots.iter().map(|root| (root.0, DAffine3::IDENTITY)).collect();
    while let Some((id, scene_from_parent)) = stack.pop() {
        let Some(node) = nodes.get(id).filter(|_| found[id].is_none()) else { continue };
        let scene_from_node = scene_from_parent * transform(id, node)?;
        found[id] = Some(scene_from_node);
        stack.extend(node.children.iter().map(|child| (child.0, scene_from_node)));
    }
    Ok(found)
}
