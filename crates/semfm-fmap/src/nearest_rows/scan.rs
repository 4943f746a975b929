//! What a tile of queries looks at: the inner loops of the search, in wide registers.
//!
//! They are values and plain loops: a closure that the compiler does not inline is compiled without the
//! wide registers, and calls a function for each of their instructions.

use pulp::Simd;

use super::panels::{Balls, CHUNK, PANEL, Packed, TILE};

/// A point as far as a query reaches: its squared distance in f32 and its id.
#[derive(Clone, Copy, Debug)]
pub(super) struct Near {
    pub square: f32,
    pub id: u32,
}

/// What a thread keeps between tiles.
pub(super) struct Scratch {
    /// Squared distances from the centres of the balls, panel after panel.
    from_centres: Vec<[[f32; PANEL]; TILE]>,
    /// The panels that a tile has seen.
    seen: Vec<bool>,
    /// Points within reach of each query, some of them no longer when the reach has shrunk.
    pub near: [Vec<Near>; TILE],
    /// How far each query reaches.
    pub reach: [f32; TILE],
}

impl Scratch {
    pub fn new(points: &Packed<PANEL>, balls: &Balls) -> Self {
        Self {
            from_centres: vec![[[0.0; PANEL]; TILE]; balls.n_panels()],
            seen: vec![false; points.n_groups()],
            near: Default::default(),
            reach: [f32::INFINITY; TILE],
        }
    }
}

/// How far a query must look: d (1 + relative) + absolute, so that no rounding hides a point at distance d.
#[derive(Clone, Copy)]
pub(super) struct Margin {
    pub relative: f32,
    pub absolute: f32,
}

impl Margin {
    pub fn beyond(self, distance: f32) -> f32 {
        distance * (1.0 + self.relative) + self.absolute
    }
}

/// Where the search of a tile starts.
pub(super) enum Start<'a> {
    /// Each query reaches as far as its nearest point, which is among these panels or beats all of them.
    Panels(&'a [u32]),
    /// The same, from the panel whose centre is nearest to each query.
    Nearest,
    /// The reach of each query is given and stays: everything within it is wanted.
    Within,
}

/// All points within reach of a tile's queries, into [`Scratch::near`].
pub(super) struct ScanTile<'a> {
    pub queries: &'a [f32],
    pub points: &'a Packed<PANEL>,
    /// Radii of the points, which stand for balls; none for points alone.
    pub radii: &'a [[f32; PANEL]],
    pub balls: &'a Balls,
    pub margin: Margin,
    pub start: Start<'a>,
    pub scratch: &'a mut Scratch,
}

impl pulp::WithSimd for ScanTile<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        match S::F32_LANES {
            16 => self.scan::<S, 1>(simd),
            8 => self.scan::<S, 2>(simd),
            4 => self.scan::<S, 4>(simd),
            _ => self.scan::<S, PANEL>(simd),
        }
    }
}

impl ScanTile<'_> {
    #[inline(always)]
    fn scan<S: Simd, const N: usize>(mut self, simd: S) {
        self.scratch.near.iter_mut().for_each(Vec::clear);
        self.scratch.seen.fill(false);
        let head = &self.queries[..self.queries.len().min(CHUNK * TILE)];
        for (panel, out) in self.scratch.from_centres.iter_mut().enumerate() {
            let mut sums = [[simd.splat_f32s(0.0); N]; TILE];
            add_squares(simd, self.balls.centres(panel), head, &mut sums);
            store::<S, N>(&sums, out);
        }
        match self.start {
            Start::Panels(panels) => {
                for &panel in panels {
                    self.look_into::<S, N>(simd, panel as usize);
                }
            }
            Start::Nearest => {
                for panel in self.nearest_centres() {
                    self.look_into::<S, N>(simd, panel);
                }
            }
            Start::Within => {}
        }
        for panel in 0..self.balls.n_panels() {
            let wanted = self.wanted(panel);
            for (lane, _) in wanted.iter().enumerate().filter(|(_, wanted)| **wanted != 0) {
                self.look_into::<S, N>(simd, panel * PANEL + lane);
            }
        }
    }

    /// The panel with the centre nearest to each query.
    #[inline(always)]
    fn nearest_centres(&self) -> [usize; TILE] {
        let n = self.points.n_groups();
        std::array::from_fn(|q| {
            let squares = self.scratch.from_centres.iter().flat_map(|panel| panel[q]).take(n);
            squares.enumerate().fold((0, f32::INFINITY), |m, x| if x.1 < m.1 { x } else { m }).0
        })
    }

    /// Which balls of a panel come within reach of some query; not 0 for those.
    #[inline(always)]
    fn wanted(&self, panel: usize) -> [u32; PANEL] {
        let mut wanted = [0u32; PANEL];
        let radii = self.balls.radii(panel);
        for (squares, reach) in self.scratch.from_centres[panel].iter().zip(self.scratch.reach) {
            for ((wanted, square), radius) in wanted.iter_mut().zip(squares).zip(radii) {
                let reach = reach + radius;
                *wanted |= u32::from(*square <= reach * reach);
            }
        }
        wanted
    }

    /// Notes the points of a panel that are within reach.
    #[inline(always)]
    fn look_into<S: Simd, const N: usize>(&mut self, simd: S, g: usize) {
        if g >= self.points.n_groups() || self.scratch.seen[g] {
            return;
        }
        self.scratch.seen[g] = true;
        let radii = self.radii.get(g).copied().unwrap_or_default();
        let mut sums = [[simd.splat_f32s(0.0); N]; TILE];
        let chunks = self.points.group(g).chunks(CHUNK * PANEL);
        for (points, queries) in chunks.zip(self.queries.chunks(CHUNK * TILE)) {
            add_squares(simd, points, queries, &mut sums);
            if !is_any_within(simd, &sums, &self.scratch.reach, &radii) {
                return;
            }
        }
        for (q, sums) in sums.iter().enumerate() {
            let reach = self.scratch.reach[q];
            if is_any_within(simd, std::array::from_ref(sums), &[reach], &radii) {
                let mut squares = [0.0f32; PANEL];
                S::as_mut_simd_f32s(&mut squares).0.copy_from_slice(sums);
                self.note(q, &squares, &radii, g);
            }
        }
    }

    /// Notes those of a panel's points that are within reach of a query.
    fn note(&mut self, q: usize, squares: &[f32; PANEL], radii: &[f32; PANEL], g: usize) {
        let shrinks = !matches!(self.start, Start::Within);
        let ids = &self.points.ids[g * PANEL..][..PANEL];
        let reach = &mut self.scratch.reach[q];
        for ((&square, radius), &id) in squares.iter().zip(radii).zip(ids) {
            let limit = *reach + radius;
            if square <= limit * limit {
                self.scratch.near[q].push(Near { square, id });
                if shrinks {
                    *reach = reach.min(self.margin.beyond(square.sqrt()));
                }
            }
        }
    }
}

/// sums\[q\]\[p\] += Σ_c (p_c − q_c)² over some columns of a panel and a tile.
#[inline(always)]
fn add_squares<S: Simd, const N: usize>(
    simd: S,
    points: &[f32],
    queries: &[f32],
    sums: &mut [[S::f32s; N]; TILE],
) {
    let (points, _) = S::as_simd_f32s(points).0.as_chunks::<N>();
    let (queries, _) = queries.as_chunks::<TILE>();
    let mut held = *sums;
    for (points, queries) in points.iter().zip(queries) {
        for (sums, &query) in held.iter_mut().zip(queries) {
            let query = simd.splat_f32s(query);
            for (sum, &point) in sums.iter_mut().zip(points) {
                let difference = simd.sub_f32s(point, query);
                *sum = simd.mul_add_e_f32s(difference, difference, *sum);
            }
        }
    }
    *sums = held;
}

/// Whether any sum of some queries is at most (reach + radius)².
#[inline(always)]
fn is_any_within<S: Simd, const N: usize>(
    simd: S,
    sums: &[[S::f32s; N]],
    reach: &[f32],
    radii: &[f32; PANEL],
) -> bool {
    let radii = S::as_simd_f32s(radii).0;
    let mut any = simd.less_than_f32s(simd.splat_f32s(1.0), simd.splat_f32s(0.0));
    for (sums, &reach) in sums.iter().zip(reach) {
        let reach = simd.splat_f32s(reach);
        for (&sum, &radius) in sums.iter().zip(radii) {
            let limit = simd.add_f32s(reach, radius);
            let within = simd.less_than_or_equal_f32s(sum, simd.mul_f32s(limit, limit));
            any = simd.or_m32s(any, within);
        }
    }
    simd.first_true_m32s(any) < S::F32_LANES
}

#[inline(always)]
fn store<S: Simd, const N: usize>(sums: &[[S::f32s; N]; TILE], out: &mut [[f32; PANEL]; TILE]) {
    for (sums, out) in sums.iter().zip(out) {
        S::as_mut_simd_f32s(out).0.copy_from_slice(sums);
    }
}
