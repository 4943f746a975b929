//! Traversal of the scene, which gathers its triangles.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use super::UNCOMPRESSED;
use super::accessor::{Accessors, Component};
use super::json::{MeshGpuInstancing, Node, Primitive, Whole};
use super::material::Surface;
use super::skin::{PosedSkin, scene_from_nodes};
use crate::io::appearance::{Appearance, MISSING_UV, rgba_from_floats};
use crate::io::format_row::MeshParts;
use crate::io::image::ImageBudget;
use crate::math::{DAffine3, DMat4, DQuat, DVec3};
use crate::{Error, Result};

/// Displacements of morph targets that are added, for each vertex that a file may have: every target may have as many as
/// its mesh has vertices, and all may share their bytes.
const TARGETS_PER_VERTEX: usize = 32;

/// Where a mesh is shown.
#[derive(Clone, Copy)]
enum Placement<'a> {
    /// All of it moved alike: `scene_from_mesh`.
    Rigid(DAffine3),
    /// Each vertex with its joints; what has none, with its node.
    Skinned(&'a PosedSkin, DAffine3),
}

pub(crate) struct SceneReader<'a> {
    accessors: &'a Accessors<'a>,
    parts: MeshParts,
    budget: Option<ImageBudget>,
    surfaces: HashMap<Option<usize>, (u32, Surface)>,
    material_of: Vec<u32>,
    /// Displacements of morph targets read so far.
    n_displacements: usize,
    /// Nodes that are hidden, primitives that are points or lines.
    n_hidden: usize,
    n_without_surface: usize,
}

impl<'a> SceneReader<'a> {
    pub fn new(accessors: &'a Accessors<'a>) -> Self {
        let parts = MeshParts {
            vertices: vec![],
            faces: vec![],
            n_faces: 0,
            appearance: Appearance::default(),
        };
        Self {
            accessors,
            parts,
            budget: None,
            surfaces: HashMap::new(),
            material_of: Vec::new(),
            n_displacements: 0,
            n_hidden: 0,
            n_without_surface: 0,
        }
    }

    /// Reads all triangles of the default scene. Without any scene the file is a library: the nodes
    /// without a parent are shown, and where no node shows a mesh, each mesh once.
    pub fn read(mut self) -> Result<MeshParts> {
        let root = self.accessors.root;
        let scene = match root.scene {
            Some(scene) => Some(root.scenes.get(scene.0).ok_or_else(|| {
                let found = format!("scene {} of {}", scene.0, root.scenes.len());
                self.accessors.input.error("scene", "a scene that exists", found)
            })?),
            None => root.scenes.first(),
        };
        match scene {
            Some(scene) => self.traverse(&scene.nodes)?,
            None if root.nodes.iter().any(|node| node.mesh.is_some()) => {
                self.traverse(&parentless(&root.nodes))?
            }
            None => {
                for mesh in 0..root.meshes.len() {
                    self.add_mesh(mesh, None, Placement::Rigid(DAffine3::IDENTITY))?;
                }
            }
        }
        Ok(self.finish())
    }

    /// Visits nodes depth first, children in order. A node met twice would make the tree a graph,
    /// or a ring without end, both of which glTF forbids.
    fn traverse(&mut self, roots: &[Whole]) -> Result<()> {
        let root = self.accessors.root;
        let poses = if root.nodes.iter().any(|node| node.skin.is_some()) {
            scene_from_nodes(&root.nodes, &parentless(&root.nodes), |id, n| self.transform(id, n))?
        } else {
            Vec::new()
        };
        let mut skins: HashMap<usize, PosedSkin> = HashMap::new();
        let mut met = vec![false; root.nodes.len()];
        let mut stack: Vec<(usize, DAffine3, bool)> =
            roots.iter().rev().map(|node| (node.0, DAffine3::IDENTITY, true)).collect();
        while let Some((id, scene_from_parent, parent_is_visible)) = stack.pop() {
            let Some(node) = root.nodes.get(id) else {
                let found = format!("{} of them", root.nodes.len());
                return Err(self.error_at_node(id, "a node that exists", found));
            };
            if std::mem::replace(&mut met[id], true) {
                return Err(self.error_at_node(id, "one parent", "the node is met twice".into()));
            }
            let scene_from_node = scene_from_parent * self.transform(id, node)?;
            // A node is shown where it and all above it are visible (KHR_node_visibility).
            let told = node.extensions.visibility.as_ref().and_then(|told| told.visible);
            let is_visible = parent_is_visible && told.unwrap_or(true);
            if let Some(mesh) = node.mesh {
                let weights = node.weights.as_deref();
                if !is_visible {
                    self.n_hidden += 1;
                } else if let Some(Whole(skin)) = node.skin {
                    if let Entry::Vacant(unknown) = skins.entry(skin) {
                        unknown.insert(PosedSkin::new(self.accessors, skin, &poses)?);
                    }
                    let placement = Placement::Skinned(&skins[&skin], scene_from_node);
                    self.add_mesh(mesh.0, weights, placement)?;
                } else if let Some(instancing) = &node.extensions.instancing {
                    for node_from_instance in self.instances(id, instancing, mesh.0)? {
                        let placement = Placement::Rigid(scene_from_node * node_from_instance);
                        self.add_mesh(mesh.0, weights, placement)?;
                    }
                } else {
                    self.add_mesh(mesh.0, weights, Placement::Rigid(scene_from_node))?;
                }
            }
            let children = node.children.iter().rev();
            stack.extend(children.map(|child| (child.0, scene_from_node, is_visible)));
        }
        Ok(())
    }

    /// The poses of a mesh that one node shows many times (EXT_mesh_gpu_instancing).
    fn instances(
        &self,
        id: usize,
        instancing: &MeshGpuInstancing,
        mesh: usize,
    ) -> Result<Vec<DAffine3>> {
        let mut count = None;
        for &Whole(accessor) in instancing.attributes.values() {
            let n = self.accessors.get(accessor)?.count.0;
            if *count.get_or_insert(n) != n {
                let expected = "as many translations as rotations and scales";
                return Err(self.error_at_node(id, expected, "other counts".into()));
            }
        }
        let count = count.unwrap_or(0);
        // Before anything is reserved for them: each shows a primitive at least.
        let n_primitives =
            self.accessors.root.meshes.get(mesh).map_or(0, |mesh| mesh.primitives.len()).max(1);
        if count.saturating_mul(n_primitives) > self.accessors.max_vertices() {
            let expected = format!("at most {} instances", self.accessors.max_vertices());
            return Err(self.error_at_node(id, &expected, count.to_string()));
        }
        let attribute = |name: &str| instancing.attributes.get(name).map(|accessor| accessor.0);
        let vectors = |name: &str, default: f64| match attribute(name) {
            Some(accessor) => self.accessors.vectors::<3>(accessor, &[Component::F32]),
            None => Ok(vec![[default; 3]; count]),
        };
        let (translations, scales) = (vectors("TRANSLATION", 0.0)?, vectors("SCALE", 1.0)?);
        let rotations = match attribute("ROTATION") {
            Some(accessor) => {
                let allowed = [Component::F32, Component::I8, Component::I16];
                self.accessors.vectors::<4>(accessor, &allowed)?
            }
            None => vec![[0.0, 0.0, 0.0, 1.0]; count],
        };
        let parts = translations.into_iter().zip(rotations).zip(scales);
        parts
            .map(|((translation, rotation), scale)| self.placed(id, translation, rotation, scale))
            .collect()
    }

    /// `parent_from_node`: the matrix, or translation × rotation × scale.
    fn transform(&self, id: usize, node: &Node) -> Result<DAffine3> {
        let vectors = node.translation.iter().flatten().chain(node.rotation.iter().flatten());
        let mut numbers =
            node.matrix.iter().flatten().chain(vectors).chain(node.scale.iter().flatten());
        // Renderers keep these in 32 bits; beyond them nothing sensible is meant.
        if let Some(x) = numbers.find(|x| x.abs() > f64::from(f32::MAX)) {
            let expected = "a transform of finite 32-bit numbers";
            return Err(self.error_at_node(id, expected, format!("{x:e}")));
        }
        if let Some(matrix) = &node.matrix {
            let matrix = DMat4::from_cols_array(matrix);
            if matrix.row(3).to_array() != [0.0, 0.0, 0.0, 1.0] {
                let expected = "a matrix whose last row is 0 0 0 1";
                return Err(self.error_at_node(id, expected, matrix.row(3).to_string()));
            }
            return Ok(DAffine3::from_mat4(matrix));
        }
        let rotation = node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]);
        self.placed(
            id,
            node.translation.unwrap_or_default(),
            rotation,
            node.scale.unwrap_or([1.0; 3]),
        )
    }

    /// Translation × rotation × scale.
    fn placed(
        &self,
        id: usize,
        translation: [f64; 3],
        rotation: [f64; 4],
        scale: [f64; 3],
    ) -> Result<DAffine3> {
        let rotation = DQuat::from_array(rotation);
        if rotation.length_squared() == 0.0 {
            return Err(self.error_at_node(id, "a unit quaternion", rotation.to_string()));
        }
        Ok(DAffine3::from_scale_rotation_translation(
            DVec3::from_array(scale),
            rotation.normalize(),
            DVec3::from_array(translation),
        ))
    }

    fn error_at_node(&self, id: usize, expected: &str, found: String) -> Error {
        self.accessors.input.error(format!("node {id}"), expected, found)
    }

    /// Shows a mesh. `weights` of its morph targets are those of the node that shows it, where that has any.
    fn add_mesh(
        &mut self,
        mesh: usize,
        weights: Option<&[f64]>,
        placement: Placement<'_>,
    ) -> Result<()> {
        let meshes = &self.accessors.root.meshes;
        let Some(json) = meshes.get(mesh) else {
            let found = format!("{} of them", meshes.len());
            return Err(self.accessors.input.error(
                format!("mesh {mesh}"),
                "a mesh that exists",
                found,
            ));
        };
        for (i, primitive) in json.primitives.iter().enumerate() {
            let place = format!("mesh {mesh}, primitive {i}");
            self.add_primitive(&place, primitive, weights.unwrap_or(&json.weights), placement)?;
        }
        Ok(())
    }

    /// Copies a primitive's vertices and triangles. One without positions shows nothing.
    fn add_primitive(
        &mut self,
        place: &str,
        primitive: &Primitive,
        weights: &[f64],
        placement: Placement<'_>,
    ) -> Result<()> {
        let mode = primitive.mode.map_or(4, |mode| mode.0);
        let Some(&Whole(position)) = primitive.attributes.get("POSITION") else { return Ok(()) };
        if mode < 4 {
            self.n_without_surface += 1;
            return Ok(());
        }
        let input = self.accessors.input;
        let json = self.accessors.get(position)?;
        if json.buffer_view.is_none()
            && primitive.extensions.contains_key("KHR_draco_mesh_compression")
        {
            let found = "KHR_draco_mesh_compression";
            return Err(input.error(place, UNCOMPRESSED, found));
        }
        let n_vertices = json.count.0;
        let n_corners = match primitive.indices {
            Some(indices) => self.accessors.get(indices.0)?.count.0,
            None => n_vertices,
        };
        self.check_budget(place, n_vertices, n_corners)?;
        let quantized =
            self.accessors.root.extensions_used.iter().any(|name| name == "KHR_mesh_quantization");
        let allowed: &[Component] = if quantized {
            &[Component::F32, Component::I8, Component::U8, Component::I16, Component::U16]
        } else {
            &[Component::F32]
        };
        let mut positions: Vec<DVec3> = self
            .accessors
            .vectors::<3>(position, allowed)?
            .into_iter()
            .map(DVec3::from_array)
            .collect();
        self.morph(place, primitive, weights, &mut positions)?;
        let corners = match primitive.indices {
            Some(indices) => self.accessors.indices(indices.0)?,
            None => (0..n_vertices as u32).collect(),
        };
        if let Some(id) = corners.iter().find(|&&id| id as usize >= n_vertices) {
            return Err(input.error(place, format!("indices below {n_vertices}"), id.to_string()));
        }
        let Some(mut triangles) = triangles(mode, &corners) else {
            return Err(input.error(place, "a mode from 0 to 6", mode.to_string()));
        };
        self.put_in_scene(place, primitive, placement, &mut positions, &mut triangles)?;
        let offset = self.parts.vertices.len();
        self.parts.vertices.extend(positions);
        self.add_colors(place, primitive, offset, n_vertices);
        self.add_material(place, primitive, n_vertices, &triangles);
        let shifted = triangles.into_iter().map(|triangle| triangle.map(|id| id + offset as u32));
        self.parts.faces.extend(shifted);
        Ok(())
    }

    /// Moves positions from the mesh's frame into the scene; where that mirrors, triangles are turned around so that
    /// they still face outwards.
    fn put_in_scene(
        &self,
        place: &str,
        primitive: &Primitive,
        placement: Placement<'_>,
        positions: &mut [DVec3],
        triangles: &mut [[u32; 3]],
    ) -> Result<()> {
        let scene_from_mesh = match placement {
            Placement::Rigid(scene_from_mesh) => scene_from_mesh,
            Placement::Skinned(skin, scene_from_node) => {
                let poses = skin.of_vertices(self.accessors, place, primitive, positions.len())?;
                if let Some(poses) = poses {
                    for triangle in triangles {
                        let signs = triangle.map(|id| poses[id as usize].matrix3.determinant());
                        if signs.iter().sum::<f64>() < 0.0 {
                            triangle.swap(1, 2);
                        }
                    }
                    for (position, pose) in positions.iter_mut().zip(poses) {
                        *position = pose.transform_point3(*position);
                    }
                    return Ok(());
                }
                scene_from_node
            }
        };
        if scene_from_mesh.matrix3.determinant() < 0.0 {
            triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        }
        positions.iter_mut().for_each(|p| *p = scene_from_mesh.transform_point3(*p));
        Ok(())
    }

    /// Adds the displacements of the morph targets that have a weight (glTF 2.0, section 3.7.2.2).
    fn morph(
        &mut self,
        place: &str,
        primitive: &Primitive,
        weights: &[f64],
        positions: &mut [DVec3],
    ) -> Result<()> {
        let targets = primitive.targets.iter().zip(weights).filter(|(_, weight)| **weight != 0.0);
        for (target, &weight) in targets {
            let Some(&Whole(accessor)) = target.get("POSITION") else { continue };
            let input = self.accessors.input;
            let count = self.accessors.get(accessor)?.count.0;
            if count != positions.len() {
                let expected = format!("morph targets of {} displacements", positions.len());
                return Err(input.error(place, expected, count.to_string()));
            }
            self.n_displacements = self.n_displacements.saturating_add(count);
            let most = TARGETS_PER_VERTEX.saturating_mul(self.accessors.max_vertices());
            if self.n_displacements > most {
                let expected = format!("at most {most} displacements of morph targets");
                return Err(input.error(place, expected, "more"));
            }
            let allowed =
                [Component::F32, Component::I8, Component::U8, Component::I16, Component::U16];
            let displacements = self.accessors.vectors::<3>(accessor, &allowed)?;
            for (position, displacement) in positions.iter_mut().zip(displacements) {
                *position += weight * DVec3::from_array(displacement);
            }
        }
        Ok(())
    }

    /// Refuses what instances multiply beyond measure, before anything is reserved for it.
    fn check_budget(&self, place: &str, n_vertices: usize, n_corners: usize) -> Result<()> {
        let max_vertices = self.accessors.max_vertices();
        let max_triangles = self.accessors.max_triangles();
        if self.parts.vertices.len().saturating_add(n_vertices) > max_vertices
            || self.parts.faces.len().saturating_add(n_corners) > 3 * max_triangles
        {
            let expected = format!(
                "at most {max_vertices} vertices and {max_triangles} triangles from a file of this size (show fewer \
                 instances)"
            );
            let found = format!("{n_vertices} vertices and {n_corners} corners more");
            return Err(self.accessors.input.error(place, expected, found));
        }
        Ok(())
    }

    /// `COLOR_0`, taken as it stands: the specification calls it linear, but what writes it and
    /// what shows it in practice mean sRGB. Vertices without a colour are white.
    fn add_colors(&mut self, place: &str, primitive: &Primitive, offset: usize, n_vertices: usize) {
        let appearance = &mut self.parts.appearance;
        let n_total = offset + n_vertices;
        if let Some(&Whole(accessor)) = primitive.attributes.get("COLOR_0") {
            let allowed = [Component::F32, Component::U8, Component::U16];
            let kind = self.accessors.get(accessor).map(|json| (json.kind.as_str(), json.count.0));
            let colors: Result<Vec<[u8; 4]>> = match kind {
                Ok((_, count)) if count != n_vertices => Ok(Vec::new()),
                Ok(("VEC3", _)) => self.accessors.vectors::<3>(accessor, &allowed).map(|colors| {
                    colors
                        .into_iter()
                        .map(|[r, g, b]| rgba_from_floats([r, g, b, 1.0].map(|x| x as f32)))
                        .collect()
                }),
                Ok(_) => self.accessors.vectors::<4>(accessor, &allowed).map(|colors| {
                    colors
                        .into_iter()
                        .map(|color| rgba_from_floats(color.map(|x| x as f32)))
                        .collect()
                }),
                Err(error) => Err(error),
            };
            match colors {
                Ok(colors) if colors.len() == n_vertices => {
                    let all = appearance.vertex_colors.get_or_insert_default();
                    all.resize(offset, [255; 4]);
                    all.extend(colors);
                }
                Ok(_) => appearance.notes.push(format!("{place}: not as many colours as vertices")),
                Err(error) => appearance.notes.push(error.to_string()),
            }
        }
        if let Some(all) = &mut appearance.vertex_colors {
            all.resize(n_total, [255; 4]);
        }
    }

    fn add_material(
        &mut self,
        place: &str,
        primitive: &Primitive,
        n_vertices: usize,
        triangles: &[[u32; 3]],
    ) {
        let key = primitive.material.map(|material| material.0);
        if !self.surfaces.contains_key(&key) {
            let notes = &mut self.parts.appearance.notes;
            let surface = Surface::read(self.accessors, key, &mut self.budget, notes);
            self.surfaces.insert(key, (self.surfaces.len() as u32, surface));
        }
        let (number, surface) = &self.surfaces[&key];
        let n_before = self.parts.faces.len();
        self.material_of.resize(n_before + triangles.len(), *number);
        let appearance = &mut self.parts.appearance;
        let set = format!("TEXCOORD_{}", surface.uv_set);
        let accessor =
            primitive.attributes.get(&set).filter(|_| surface.material.texture.is_some());
        if let Some(&Whole(accessor)) = accessor {
            let fits = self.accessors.get(accessor).is_ok_and(|json| json.count.0 == n_vertices);
            match surface.uvs(self.accessors, accessor) {
                Ok(uvs) if fits => {
                    let all = appearance.corner_uvs.get_or_insert_default();
                    all.resize(n_before, [MISSING_UV; 3]);
                    all.extend(triangles.iter().map(|ids| ids.map(|id| uvs[id as usize])));
                }
                Ok(_) => appearance
                    .notes
                    .push(format!("{place}: not as many texture coordinates as vertices")),
                Err(error) => appearance.notes.push(error.to_string()),
            }
        }
        if let Some(all) = &mut appearance.corner_uvs {
            all.resize(n_before + triangles.len(), [MISSING_UV; 3]);
        }
    }

    fn finish(mut self) -> MeshParts {
        let appearance = &mut self.parts.appearance;
        for (count, what) in [
            (self.n_hidden, "nodes are hidden (KHR_node_visibility) and left out"),
            (self.n_without_surface, "primitives are points or lines and left out"),
            (
                self.accessors.root.animations.len(),
                "animations are not played: nodes stand as placed",
            ),
        ] {
            if count > 0 {
                appearance.notes.push(format!("{count} {what}"));
            }
        }
        if self.surfaces.keys().any(Option::is_some) {
            let mut surfaces: Vec<_> = self.surfaces.into_values().collect();
            surfaces.sort_by_key(|&(number, _)| number);
            appearance.materials =
                surfaces.into_iter().map(|(_, surface)| surface.material).collect();
            appearance.material_of = (appearance.materials.len() > 1).then_some(self.material_of);
        }
        self.parts.n_faces = self.parts.faces.len();
        self.parts
    }
}

/// Nodes that are nobody's child.
fn parentless(nodes: &[Node]) -> Vec<Whole> {
    let mut is_child = vec![false; nodes.len()];
    for child in nodes.iter().flat_map(|node| &node.children) {
        if let Some(flag) = is_child.get_mut(child.0) {
            *flag = true;
        }
    }
    (0..nodes.len()).filter(|&id| !is_child[id]).map(Whole).collect()
}

/// The triangles of a list (4), a strip (5) or a fan (6), with the corner order of glTF 2.0,
/// section 3.7.2.1; `None` for another mode. Corners that do not complete a triangle are left over.
fn triangles(mode: usize, corners: &[u32]) -> Option<Vec<[u32; 3]>> {
    let strip = corners.windows(3).enumerate();
    match mode {
        4 => Some(corners.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect()),
        5 => Some(strip.map(|(i, c)| [c[0], c[1 + i % 2], c[2 - i % 2]]).collect()),
        6 => Some(corners.windows(2).skip(1).map(|c| [c[0], c[1], corners[0]]).collect()),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_and_fans_keep_their_winding() {
        assert_eq!(triangles(5, &[0, 1, 2, 3, 4]).unwrap(), [[0, 1, 2], [1, 3, 2], [2, 3, 4]]);
        assert_eq!(triangles(6, &[0, 1, 2, 3]).unwrap(), [[1, 2, 0], [2, 3, 0]]);
        assert_eq!(triangles(4, &[0, 1, 2, 3]).unwrap(), [[0, 1, 2]]);
        assert!(triangles(6, &[0]).unwrap().is_empty());
        assert!(triangles(7, &[0]).is_none());
    }
}
