//! Edge collapse that cannot change the topology, on a subset of the vertices.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use crate::math::{DMat3, DVec3};
use crate::{Mesh, Result, Task};

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
}

/// Moves vertices onto neighbours, cheapest first, until `target` are left or none can go.
///
/// The cost is a quadric (Garland & Heckbert 1997) plus edge length. A collapse is made only where
/// the link condition holds (Dey, Edelsbrunner, Guha & Nekhayev, Topology Preserving Edge
/// Contraction, 1999), so that components, holes and handles all survive; vertices where the
/// surface is not a manifold stay where they are.
pub(crate) fn collapse(mesh: &Mesh, target: usize, task: &Task) -> Result<Collapsed> {
    let mut state = State::new(mesh);
    let mut n_vertices = state.faces_of.iter().filter(|faces| !faces.is_empty()).count();
    // A refused collapse may become possible once its surroundings have changed: go over the
    // edges again until a pass changes nothing.
    loop {
        let n_before = n_vertices;
        let ids = 0..mesh.n_vertices() as u32;
        let mut queue: BinaryHeap<Edge> = ids.filter_map(|id| state.next_edge(id, None)).collect();
        while n_vertices > target {
            let Some(edge) = queue.pop() else { break };
            if edge.stamp != state.stamp[edge.from as usize] {
                continue;
            }
            if !(state.keeps_shape(edge.from, edge.to) && state.keeps_topology(edge.from, edge.to))
            {
                queue.extend(state.next_edge(edge.from, Some(&edge)));
                continue;
            }
            for id in state.collapse(edge.from, edge.to) {
                state.stamp[id as usize] += 1;
                queue.extend(state.next_edge(id, None));
            }
            n_vertices -= 1;
            if n_vertices.is_multiple_of(1024) {
                task.check()?;
            }
        }
        if n_vertices <= target || n_vertices == n_before {
            break;
        }
    }
    let faces = state.faces.into_iter().filter(|&ids| ids != GONE).collect();
    Ok(Collapsed { faces, kept: state.faces_of.iter().map(|faces| !faces.is_empty()).collect() })
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

struct State {
    points: Vec<DVec3>,
    faces: Vec<[u32; 3]>,
    faces_of: Vec<Vec<u32>>,
    kind: Vec<Kind>,
    quadric: Vec<Quadric>,
    /// Grows whenever the collapse of a vertex that waits in the queue becomes void.
    stamp: Vec<u32>,
    /// Scratch: how often a vertex was met, all 0 between calls.
    met: Vec<u32>,
}

impl State {
    fn new(mesh: &Mesh) -> Self {
        let n = mesh.n_vertices();
        let (low, high) = mesh.bounds();
        let centre = low.midpoint(high);
        let points: Vec<DVec3> = mesh.vertices().iter().map(|&p| p - centre).collect();
        let mut faces_of = vec![Vec::new(); n];
        let mut quadric = vec![Quadric::ZERO; n];
        for (face, ids) in mesh.faces().iter().enumerate() {
            let normal = mesh.face_normal_scaled(face);
            for &id in ids {
                faces_of[id as usize].push(face as u32);
                quadric[id as usize].add_plane(normal, points[ids[0] as usize]);
            }
        }
        let mut state = Self {
            points,
            faces: mesh.faces().to_vec(),
            faces_of,
            kind: vec![Kind::Interior; n],
            quadric,
            stamp: vec![0; n],
            met: vec![0; n],
        };
        for id in 0..n as u32 {
            state.kind[id as usize] = state.look_around(id);
        }
        state.hold_borders();
        state
    }

    /// The neighbours of `id`, each with the number of triangles on the edge to it.
    fn ring(&mut self, id: u32) -> Vec<(u32, u32)> {
        let mut ring = Vec::with_capacity(8);
        for &face in &self.faces_of[id as usize] {
            for other in self.faces[face as usize] {
                if other != id {
                    if self.met[other as usize] == 0 {
                        ring.push((other, 0));
                    }
                    self.met[other as usize] += 1;
                }
            }
        }
        for (other, count) in &mut ring {
            *count = std::mem::take(&mut self.met[*other as usize]);
        }
        ring
    }

    fn look_around(&mut self, id: u32) -> Kind {
        let ring = self.ring(id);
        let n_border = ring.iter().filter(|&&(_, count)| count == 1).count();
        if ring.iter().any(|&(_, count)| count > 2) || n_border > 2 || ring.is_empty() {
            return Kind::Locked;
        }
        // One fan reaches all of its triangles from the first; two fans that touch do not.
        let faces = &self.faces_of[id as usize];
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

    /// Adds planes through the border edges, square to the surface, so that borders keep their line.
    fn hold_borders(&mut self) {
        for face in 0..self.faces.len() {
            let ids = self.faces[face];
            for k in 0..3 {
                let (a, b, c) = (ids[k], ids[(k + 1) % 3], ids[(k + 2) % 3]);
                let around = &self.faces_of[a as usize];
                if around.iter().filter(|&&f| self.faces[f as usize].contains(&b)).count() != 1 {
                    continue;
                }
                let [pa, pb, pc] = [a, b, c].map(|id| self.points[id as usize]);
                let edge = pb - pa;
                let normal = edge.cross(pc - pa).cross(edge).normalize_or_zero();
                for id in [a, b] {
                    self.quadric[id as usize].add_plane(normal * edge.length_squared(), pa);
                }
            }
        }
    }

    /// The cheapest collapse of `from` that comes after `last`; each vertex has one in the queue.
    ///
    /// What it costs depends on positions and on the quadric of `from` alone, so that it stays right
    /// until another vertex is merged into `from` or its neighbours change.
    fn next_edge(&mut self, from: u32, last: Option<&Edge>) -> Option<Edge> {
        if self.kind[from as usize] == Kind::Locked {
            return None;
        }
        let (start, stamp) = (self.points[from as usize], self.stamp[from as usize]);
        let ring = self.ring(from);
        let edges = ring.into_iter().map(|(to, _)| {
            let end = self.points[to as usize];
            let cost = self.quadric[from as usize].squared_distance(end)
                + EVENNESS * EVENNESS * start.distance_squared(end);
            Edge { cost, from, to, stamp }
        });
        edges.filter(|edge| last.is_none_or(|last| edge < last)).max()
    }

    /// The link condition lk(from) ∩ lk(to) = lk(edge), with every border edge closed by a triangle
    /// to one vertex at infinity; and a border moves only along itself.
    fn keeps_topology(&mut self, from: u32, to: u32) -> bool {
        let (ring, other) = (self.ring(from), self.ring(to));
        let Some(&(_, n_shared)) = ring.iter().find(|&&(id, _)| id == to) else { return false };
        let wanted = if self.kind[from as usize] == Kind::Border { 1 } else { 2 };
        if n_shared != wanted {
            return false;
        }
        for &(id, count) in &other {
            self.met[id as usize] = count;
        }
        let common: Vec<(u32, bool)> = ring
            .iter()
            .filter(|&&(id, _)| self.met[id as usize] > 0)
            .map(|&(id, count)| (id, count == 1 && self.met[id as usize] == 1))
            .collect();
        for &(id, _) in &other {
            self.met[id as usize] = 0;
        }
        if common.len() != n_shared as usize {
            return false;
        }
        match common[..] {
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
        self.faces_of[id as usize].iter().any(|&face| {
            let ids = self.faces[face as usize];
            ids.contains(&x) && ids.contains(&y)
        })
    }

    /// No triangle turns over or becomes a sliver when `from` moves onto `to`.
    fn keeps_shape(&self, from: u32, to: u32) -> bool {
        let target = self.points[to as usize];
        let (mut least_before, mut least_after) = (f64::INFINITY, f64::INFINITY);
        for &face in &self.faces_of[from as usize] {
            let ids = self.faces[face as usize];
            let before = ids.map(|id| self.points[id as usize]);
            least_before = least_before.min(quality(before));
            if ids.contains(&to) {
                continue;
            }
            let after = ids.map(|id| if id == from { target } else { self.points[id as usize] });
            let (old, new) = (normal(before), normal(after));
            if old.dot(new) < LEAST_TURN_COSINE * old.length() * new.length() {
                return false;
            }
            least_after = least_after.min(quality(after));
        }
        least_after >= LEAST_QUALITY || least_after > least_before
    }

    /// Moves `from` onto `to`; returns the vertices whose cheapest collapse may now be another.
    fn collapse(&mut self, from: u32, to: u32) -> Vec<u32> {
        let affected = self.ring(from).into_iter().map(|(id, _)| id).collect();
        for face in std::mem::take(&mut self.faces_of[from as usize]) {
            let ids = self.faces[face as usize];
            if ids.contains(&to) {
                for id in [to, third(ids, from, to)] {
                    self.faces_of[id as usize].retain(|&f| f != face);
                }
                self.faces[face as usize] = GONE;
            } else {
                self.faces[face as usize] = ids.map(|id| if id == from { to } else { id });
                self.faces_of[to as usize].push(face);
            }
        }
        let moved = self.quadric[from as usize];
        self.quadric[to as usize].add(&moved);
        self.stamp[from as usize] += 1;
        affected
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

/// Sum of squared distances to planes, weighted by area: pᵀ A p + 2 bᵀ p + c.
#[derive(Clone, Copy)]
struct Quadric {
    a: DMat3,
    b: DVec3,
    c: f64,
    weight: f64,
}

impl Quadric {
    const ZERO: Self = Self { a: DMat3::ZERO, b: DVec3::ZERO, c: 0.0, weight: 0.0 };

    /// The plane through `point`; the length of `normal` is the weight.
    fn add_plane(&mut self, normal: DVec3, point: DVec3) {
        let weight = normal.length();
        if weight <= 0.0 {
            return;
        }
        let unit = normal / weight;
        let offset = -unit.dot(point);
        let outer = DMat3::from_cols(unit * unit.x, unit * unit.y, unit * unit.z);
        let plane = Self { a: outer, b: unit * offset, c: offset * offset, weight: 1.0 };
        self.a += plane.a * weight;
        self.b += plane.b * weight;
        self.c += plane.c * weight;
        self.weight += weight;
    }

    fn add(&mut self, other: &Self) {
        self.a += other.a;
        self.b += other.b;
        self.c += other.c;
        self.weight += other.weight;
    }

    /// Mean squared distance of `point` from the planes.
    fn squared_distance(&self, point: DVec3) -> f64 {
        if self.weight <= 0.0 {
            return 0.0;
        }
        let sum = point.dot(self.a * point) + 2.0 * self.b.dot(point) + self.c;
        sum.max(0.0) / self.weight
    }
}

/// A collapse that is waiting; the cheapest is the greatest, ties by id.
#[derive(PartialEq)]
struct Edge {
    cost: f64,
    from: u32,
    to: u32,
    stamp: u32,
}

impl Eq for Edge {}

impl Ord for Edge {
    fn cmp(&self, other: &Self) -> Ordering {
        other
            .cost
            .total_cmp(&self.cost)
            .then_with(|| (other.from, other.to).cmp(&(self.from, self.to)))
    }
}

impl PartialOrd for Edge {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
