//! Edge collapse that cannot change the topology, on a subset of the vertices.
//!
//! `quadric` measures what a collapse costs, `queue` sorts them, `fans` keeps the triangles around each vertex, `spatial_order` numbers
//! the vertices so that neighbours lie near each other in memory.

mod fans;
mod quadric;
mod queue;

use self::fans::Fans;
use self::quadric::Quadric;
use self::queue::{Queue, Waiting};
use crate::math::DVec3;
use crate::{Mesh, Result, SpatialOrder, Task};

/// Weight of edge length against distance from the surface in the order of collapses: an edge of
/// length l costs as much as a vertex that strays `EVENNESS · l` from the planes it stands for.
///
/// Real objects to 4 000 vertices: .1 stays within .001–.004 of the diagonal but leaves needles on
/// flat parts, .3 within .002–.008, 1 within .003–.0095 (one boot passed .01) and rounds edges off.
const EVENNESS: f64 = 0.3;
/// A triangle may not turn by more than the angle with this cosine in one collapse.
const LEAST_TURN_COSINE: f64 = 0.3;
/// A collapse may not make a triangle of quality below this unless there was a worse one around
/// the vertex before. Quality is 1 for an equilateral triangle, 0 for a flat one.
const LEAST_QUALITY: f64 = 0.1;

/// Triangles left and, for each vertex, whether it is left.
pub(crate) struct Collapsed {
    pub faces: Vec<[u32; 3]>,
    pub kept: Vec<bool>,
    /// For each vertex of a triangle the vertex that it came to; itself where it is left.
    pub came_to: Vec<u32>,
}

/// One collapse: `from` moves onto its neighbour `to`.
#[derive(Clone, Copy)]
struct Step {
    from: u32,
    to: u32,
}

/// The collapses of a mesh in their order, which does not depend on how many there shall be: the
/// mesh of any larger number of vertices is what the first of them make.
pub(crate) struct Collapses<'a> {
    mesh: &'a Mesh,
    /// Vertices in use before the first.
    n_vertices: usize,
    steps: Vec<Step>,
}

impl<'a> Collapses<'a> {
    /// Moves vertices onto neighbours, cheapest first, until `target` are left or none can go.
    ///
    /// The cost is a quadric (Garland & Heckbert 1997) plus edge length. A collapse is made only where
    /// the link condition holds (Dey, Edelsbrunner, Guha & Nekhayev, Topology Preserving Edge
    /// Contraction, 1999), so that components, holes and handles all survive; vertices where the
    /// surface is not a manifold stay where they are.
    pub(crate) fn new(mesh: &'a Mesh, target: usize, task: &Task) -> Result<Self> {
        let mut state = State::new(mesh);
        let n_vertices = state.fans.n_in_use();
        let (mut n_left, mut steps) = (n_vertices, Vec::new());
        let mut affected = Vec::new();
        // A refused collapse may become possible once its surroundings have changed: go over the
        // edges again until a pass changes nothing.
        loop {
            let n_before = n_left;
            let ids = 0..mesh.n_vertices() as u32;
            let mut queue: Queue = ids.filter_map(|id| state.choose(id, None)).collect();
            while n_left > target {
                let next = queue.pop(|waiting| state.is_void(waiting));
                let Some(Waiting { cost, name, .. }) = next else { break };
                let from = state.number_of[name as usize];
                let to = state.vertices[from as usize].choice.to;
                if !(state.keeps_shape(from, to) && state.keeps_topology(from, to)) {
                    queue.extend(state.choose(from, Some(Edge { cost, to: state.name(to) })));
                    continue;
                }
                state.collapse(from, to, &mut affected);
                queue.extend(affected.iter().filter_map(|&id| state.choose_again(id, from, to)));
                steps.push(Step { from: name, to: state.name(to) });
                n_left -= 1;
                if n_left.is_multiple_of(1024) {
                    task.check()?;
                }
            }
            if n_left <= target || n_left == n_before {
                break;
            }
        }
        Ok(Self { mesh, n_vertices, steps })
    }

    /// The mesh with `target` vertices, or with the fewest that can be.
    pub(crate) fn down_to(&self, target: usize) -> Collapsed {
        let n_steps = self.n_vertices.saturating_sub(target).min(self.steps.len());
        let n = self.mesh.n_vertices();
        let mut came_to: Vec<u32> = (0..n as u32).collect();
        // Backwards: where `to` ends is then known already.
        for &Step { from, to } in self.steps[..n_steps].iter().rev() {
            came_to[from as usize] = came_to[to as usize];
        }
        let mut kept = vec![false; n];
        let mut faces = Vec::new();
        for &before in self.mesh.faces() {
            let ids = before.map(|id| came_to[id as usize]);
            let collapsed = [(0, 1), (1, 2), (2, 0)]
                .into_iter()
                .any(|(i, j)| ids[i] == ids[j] && before[i] != before[j]);
            if !collapsed {
                faces.push(ids);
                ids.iter().for_each(|&id| kept[id as usize] = true);
            }
        }
        Collapsed { faces, kept, came_to }
    }
}

const GONE: [u32; 3] = [u32::MAX; 3];

/// How the surface looks around a vertex; a permitted collapse never changes it.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Interior,
    Border,
    /// Not a manifold here.
    Locked,
}

/// The collapse of a vertex that waits in the queue.
#[derive(Clone, Copy)]
struct Choice {
    to: u32,
    cost: f64,
    /// Whether a cheaper one was refused.
    is_second: bool,
}

impl Choice {
    const NONE: Self = Self { to: u32::MAX, cost: f64::INFINITY, is_second: true };
}

/// What is asked of a vertex together, and lies together.
#[derive(Clone, Copy)]
struct Vertex {
    point: DVec3,
    choice: Choice,
    /// The number of the vertex in the mesh.
    name: u32,
    /// Grows whenever the collapse that waits in the queue becomes void.
    stamp: u32,
    kind: Kind,
}

/// Vertices have numbers of their own here, neighbours near each other; steps, and ties between costs, go by their
/// names, which are their numbers in the mesh.
struct State {
    /// For each name its number.
    number_of: Vec<u32>,
    vertices: Vec<Vertex>,
    faces: Vec<[u32; 3]>,
    fans: Fans,
    quadric: Vec<Quadric>,
    /// Scratch: how often a vertex was met, all 0 between calls.
    met: Vec<u32>,
    /// Scratch: the neighbours of the two ends of an edge.
    rings: [Ring; 2],
}

/// Neighbours of a vertex, each with the number of triangles on the edge to it.
type Ring = Vec<(u32, u32)>;

impl State {
    fn new(mesh: &Mesh) -> Self {
        let n = mesh.n_vertices();
        let order = SpatialOrder::new(mesh.vertices());
        let (low, high) = mesh.bounds();
        let centre = low.midpoint(high);
        let points: Vec<DVec3> =
            order.name_of.iter().map(|&name| mesh.vertices()[name as usize] - centre).collect();
        let number = |name: u32| order.number_of[name as usize];
        let mut faces: Vec<[u32; 3]> = mesh.faces().iter().map(|ids| ids.map(number)).collect();
        let mut quadric = vec![Quadric::ZERO; n];
        for (face, ids) in faces.iter().enumerate() {
            let normal = mesh.face_normal_scaled(face);
            for &id in ids {
                quadric[id as usize].add_plane(normal, points[ids[0] as usize]);
            }
        }
        hold_borders(&points, &faces, &Fans::new(n, &faces), &mut quadric);
        faces.sort_by_key(|ids| ids.iter().min().copied());
        let vertices = points.into_iter().zip(&order.name_of).map(|(point, &name)| Vertex {
            point,
            choice: Choice::NONE,
            name,
            stamp: 0,
            kind: Kind::Interior,
        });
        let mut state = Self {
            number_of: order.number_of,
            vertices: vertices.collect(),
            fans: Fans::new(n, &faces),
            faces,
            quadric,
            met: vec![0; n],
            rings: Default::default(),
        };
        for id in 0..n as u32 {
            state.vertices[id as usize].kind = state.look_around(id);
        }
        state
    }

    /// The number of a vertex in the mesh.
    fn name(&self, id: u32) -> u32 {
        self.vertices[id as usize].name
    }

    /// The neighbours of `id`.
    fn ring(&mut self, id: u32, ring: &mut Ring) {
        ring.clear();
        for &face in self.fans.of(id) {
            for other in self.faces[face as usize] {
                if other != id {
                    if self.met[other as usize] == 0 {
                        ring.push((other, 0));
                    }
                    self.met[other as usize] += 1;
                }
            }
        }
        for (other, count) in ring {
            *count = std::mem::take(&mut self.met[*other as usize]);
        }
    }

    fn look_around(&mut self, id: u32) -> Kind {
        let mut ring = std::mem::take(&mut self.rings[0]);
        self.ring(id, &mut ring);
        let kind = self.kind_with(id, &ring);
        self.rings[0] = ring;
        kind
    }

    fn kind_with(&self, id: u32, ring: &Ring) -> Kind {
        let n_border = ring.iter().filter(|&&(_, count)| count == 1).count();
        if ring.iter().any(|&(_, count)| count > 2) || n_border > 2 || ring.is_empty() {
            return Kind::Locked;
        }
        // One fan reaches all of its triangles from the first; two fans that touch do not.
        let faces = self.fans.of(id);
        let start = ring.iter().find(|&&(_, count)| count == 1).unwrap_or(&ring[0]).0;
        let (mut at, mut last, mut reached) = (start, usize::MAX, 0);
        while let Some(next) =
            (0..faces.len()).find(|&k| k != last && self.faces[faces[k] as usize].contains(&at))
        {
            reached += 1;
            last = next;
            at = third(self.faces[faces[next] as usize], id, at);
            if at == start || reached > faces.len() {
                break;
            }
        }
        match (reached == faces.len(), n_border) {
            (true, 0) => Kind::Interior,
            (true, 2) => Kind::Border,
            _ => Kind::Locked,
        }
    }

    /// What moving `from` onto `to` costs. It depends on positions and on the quadric of `from` alone,
    /// so that it stays right until another vertex is merged into `from`.
    fn cost(&self, from: u32, to: u32) -> f64 {
        let (start, end) = (self.vertices[from as usize].point, self.vertices[to as usize].point);
        self.quadric[from as usize].squared_distance(end)
            + EVENNESS * EVENNESS * start.distance_squared(end)
    }

    /// Puts the cheapest collapse of `from` that comes after `last` in place of what waits for it; each
    /// vertex has one in the queue.
    fn choose(&mut self, from: u32, last: Option<Edge>) -> Option<Waiting> {
        self.vertices[from as usize].stamp += 1;
        self.vertices[from as usize].choice = Choice::NONE;
        if self.vertices[from as usize].kind == Kind::Locked {
            return None;
        }
        let mut best: Option<(Edge, u32)> = None;
        for &face in self.fans.of(from) {
            for id in self.faces[face as usize] {
                if id == from {
                    continue;
                }
                let cost = self.cost(from, id);
                let worth_a_look = best.is_none_or(|(best, _)| cost <= best.cost);
                if !worth_a_look {
                    continue;
                }
                let edge = Edge { cost, to: self.name(id) };
                let is_next = last.is_none_or(|last| last.is_before(edge));
                if is_next && best.is_none_or(|(best, _)| edge.is_before(best)) {
                    best = Some((edge, id));
                }
            }
        }
        let (Edge { cost, .. }, to) = best?;
        self.vertices[from as usize].choice = Choice { to, cost, is_second: last.is_some() };
        Some(self.waiting(from))
    }

    /// The same for `id`, a former neighbour of `from`, after `from` has moved onto `to`: what waited
    /// stays unless it is void, or the new edge to `to` is cheaper.
    fn choose_again(&mut self, id: u32, from: u32, to: u32) -> Option<Waiting> {
        let choice = self.vertices[id as usize].choice;
        if id == to || choice.to == from || choice.is_second {
            return self.choose(id, None);
        }
        let cost = self.cost(id, to);
        let waits = Edge { cost: choice.cost, to: self.name(choice.to) };
        if !(Edge { cost, to: self.name(to) }).is_before(waits) {
            return None;
        }
        self.vertices[id as usize].stamp += 1;
        self.vertices[id as usize].choice = Choice { to, cost, is_second: false };
        Some(self.waiting(id))
    }

    /// Whether another collapse of the vertex has taken the place of one in the queue.
    fn is_void(&self, waiting: &Waiting) -> bool {
        let id = self.number_of[waiting.name as usize];
        self.vertices[id as usize].stamp != waiting.stamp
    }

    /// The entry of the queue for what was chosen for `id`.
    fn waiting(&self, id: u32) -> Waiting {
        let (cost, stamp) =
            (self.vertices[id as usize].choice.cost, self.vertices[id as usize].stamp);
        Waiting { cost, name: self.name(id), stamp }
    }

    /// The link condition lk(from) ∩ lk(to) = lk(edge), with every border edge closed by a triangle
    /// to one vertex at infinity; and a border moves only along itself.
    fn keeps_topology(&mut self, from: u32, to: u32) -> bool {
        let mut rings = std::mem::take(&mut self.rings);
        self.ring(from, &mut rings[0]);
        self.ring(to, &mut rings[1]);
        let keeps = self.link_condition(from, to, &rings);
        self.rings = rings;
        keeps
    }

    fn link_condition(&mut self, from: u32, to: u32, [ring, other]: &[Ring; 2]) -> bool {
        let Some(&(_, n_shared)) = ring.iter().find(|&&(id, _)| id == to) else { return false };
        let wanted = if self.vertices[from as usize].kind == Kind::Border { 1 } else { 2 };
        if n_shared != wanted {
            return false;
        }
        for &(id, count) in other {
            self.met[id as usize] = count;
        }
        // The vertices of both links, and whether both edges to them are borders.
        let (mut common, mut n_common) = ([(0, false); 2], 0);
        for &(id, count) in ring {
            let there = self.met[id as usize];
            if there > 0 {
                if let Some(place) = common.get_mut(n_common) {
                    *place = (id, count == 1 && there == 1);
                }
                n_common += 1;
            }
        }
        for &(id, _) in other {
            self.met[id as usize] = 0;
        }
        if n_common != n_shared as usize {
            return false;
        }
        match common[..n_common] {
            // The edge from the third corner to infinity must not lie in both links.
            [(_, both_on_border)] => !both_on_border,
            // Nor the edge between the two opposite corners: that is a tetrahedron.
            [(x, _), (y, _)] => {
                !(self.have_a_triangle(from, x, y) && self.have_a_triangle(to, x, y))
            }
            _ => false,
        }
    }

    /// Whether a triangle joins `id`, `x` and `y`.
    fn have_a_triangle(&self, id: u32, x: u32, y: u32) -> bool {
        self.fans.of(id).iter().any(|&face| {
            let ids = self.faces[face as usize];
            ids.contains(&x) && ids.contains(&y)
        })
    }

    /// No triangle turns over or becomes a sliver when `from` moves onto `to`.
    fn keeps_shape(&self, from: u32, to: u32) -> bool {
        let target = self.vertices[to as usize].point;
        let (mut least_before, mut least_after) = (f64::INFINITY, f64::INFINITY);
        for &face in self.fans.of(from) {
            let ids = self.faces[face as usize];
            let before = ids.map(|id| self.vertices[id as usize].point);
            least_before = least_before.min(quality(before));
            if ids.contains(&to) {
                continue;
            }
            let after =
                ids.map(|id| if id == from { target } else { self.vertices[id as usize].point });
            let (old, new) = (normal(before), normal(after));
            if old.dot(new) < LEAST_TURN_COSINE * old.length() * new.length() {
                return false;
            }
            least_after = least_after.min(quality(after));
        }
        least_after >= LEAST_QUALITY || least_after > least_before
    }

    /// Moves `from` onto `to`; `affected` becomes the vertices whose cheapest collapse may now be
    /// another.
    fn collapse(&mut self, from: u32, to: u32, affected: &mut Vec<u32>) {
        let mut ring = std::mem::take(&mut self.rings[0]);
        self.ring(from, &mut ring);
        affected.clear();
        affected.extend(ring.iter().map(|&(id, _)| id));
        self.rings[0] = ring;
        self.fans.merge(from, to, &mut self.faces);
        let moved = self.quadric[from as usize];
        self.quadric[to as usize].add(&moved);
        self.vertices[from as usize].stamp += 1;
    }
}

/// The corner that is neither `a` nor `b`.
fn third(ids: [u32; 3], a: u32, b: u32) -> u32 {
    ids.into_iter().find(|&id| id != a && id != b).unwrap_or(a)
}

fn normal([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a)
}

/// 4√3 · area / Σ edge², 1 for an equilateral triangle.
fn quality([a, b, c]: [DVec3; 3]) -> f64 {
    let sum = a.distance_squared(b) + b.distance_squared(c) + c.distance_squared(a);
    if sum > 0.0 { 2.0 * 3f64.sqrt() * normal([a, b, c]).length() / sum } else { 0.0 }
}

/// Adds planes through the border edges, square to the surface, so that borders keep their line.
fn hold_borders(points: &[DVec3], faces: &[[u32; 3]], fans: &Fans, quadric: &mut [Quadric]) {
    for ids in faces {
        for k in 0..3 {
            let (a, b, c) = (ids[k], ids[(k + 1) % 3], ids[(k + 2) % 3]);
            if fans.of(a).iter().filter(|&&f| faces[f as usize].contains(&b)).count() != 1 {
                continue;
            }
            let [pa, pb, pc] = [a, b, c].map(|id| points[id as usize]);
            let edge = pb - pa;
            let normal = edge.cross(pc - pa).cross(edge).normalize_or_zero();
            for id in [a, b] {
                quadric[id as usize].add_plane(normal * edge.length_squared(), pa);
            }
        }
    }
}

/// A collapse of some vertex: what it costs and the name of the vertex that it moves onto.
#[derive(Clone, Copy)]
struct Edge {
    cost: f64,
    to: u32,
}

impl Edge {
    /// Cheaper; ties by name.
    fn is_before(self, other: Self) -> bool {
        self.cost.total_cmp(&other.cost).then(self.to.cmp(&other.to)).is_lt()
    }
}
