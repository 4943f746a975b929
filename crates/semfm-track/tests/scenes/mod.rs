//! Scenes for the tests and the benchmark: an object on a table before a wall, seen by a depth camera with its faults.
#![allow(dead_code)] // each user takes a part

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use semfm_align::{DepthImage, Sim3};
use semfm_geom::math::{DAffine3, DQuat, DVec3};
use semfm_geom::{Intrinsics, Mesh, Pinhole, SurfaceIndex, Task};
use semfm_views::{RenderSettings, SurfaceColor, render};

/// Depth of the wall, metres.
const WALL: f64 = 1.6;

/// Depth of what is held before the object, metres.
const BOARD: f64 = 0.35;

/// Share of the pixels at a jump of the depth that give no return.
const HOLES: f64 = 0.3;

/// Share of the others.
const DROPPED: f64 = 0.003;

/// An object and the camera before it.
pub struct Scene {
    /// In metres, any frame.
    pub mesh: Mesh,
    pub camera: Pinhole,
    surface: SurfaceIndex,
    radius: f64,
    centre: DVec3,
    /// Upward normal of the table in the camera's frame; `None` for an object in the air.
    table: Option<DVec3>,
    /// How far the table is below the object's middle, metres.
    height: f64,
    /// A box beside the object.
    distractor: bool,
}

/// What stands where in one frame.
#[derive(Clone, Copy, Debug, Default)]
pub struct Moment {
    /// Camera from the mesh; `None` where the object is away.
    pub pose: Option<Sim3>,
    /// Share of the object's pixels that a board hides, from the left.
    pub hidden: f64,
}

impl Scene {
    /// The mesh scaled to a diagonal (metres), before a camera of a width in pixels (4 : 3, 62° wide).
    pub fn new(mesh: &Mesh, diagonal: f64, width: u32) -> Self {
        let scale = diagonal / mesh.diagonal();
        let points = mesh.vertices().iter().map(|&p| scale * p).collect();
        let mesh = Mesh::new(points, mesh.faces().to_vec()).unwrap();
        let focal = 0.83 * f64::from(width);
        let height = width * 3 / 4;
        let intrinsics = Intrinsics {
            width,
            height,
            fx: focal,
            fy: focal,
            cx: f64::from(width) / 2.0,
            cy: f64::from(height) / 2.0,
        };
        let camera = Pinhole::with_pixel_centres_at_half(intrinsics, DAffine3::IDENTITY).unwrap();
        let surface = SurfaceIndex::new(&mesh).unwrap();
        let (centre, radius) = mesh.bounding_sphere();
        let up = DVec3::new(0.0, -(35f64.to_radians().cos()), -(35f64.to_radians().sin()));
        let (table, height) = (Some(up), 0.45 * radius);
        Self { mesh, camera, surface, radius, centre, table, height, distractor: true }
    }

    /// The same with the table right below an object of this rotation, so that nothing of it is in the table.
    pub fn standing(self, rotation: DQuat) -> Self {
        let below = |p: &DVec3| -(rotation * (*p - self.centre)).dot(self.up());
        let height = self.mesh.vertices().iter().map(below).fold(0.0, f64::max);
        Self { height, ..self }
    }

    /// The same without table and box.
    pub fn in_the_air(self) -> Self {
        Self { table: None, distractor: false, ..self }
    }

    /// Middle of the mesh.
    pub fn centre(&self) -> DVec3 {
        self.centre
    }

    pub fn diameter(&self) -> f64 {
        2.0 * self.radius
    }

    /// The mesh with its middle at a place and turned.
    pub fn pose(&self, middle: DVec3, rotation: DQuat) -> Sim3 {
        let translation = middle - rotation * self.centre;
        Sim3 { scale: 1.0, rotation, translation }
    }

    /// Along the table, away from the camera.
    pub fn away(&self) -> DVec3 {
        self.up().cross(DVec3::X)
    }

    /// Upward normal of the table.
    pub fn up(&self) -> DVec3 {
        self.table.unwrap_or(DVec3::NEG_Y)
    }

    /// What the camera measures: noise by Nguyen, Izadi & Lovell (*Modeling Kinect sensor noise*, 2012), pixels at jumps that
    /// take a neighbour's depth or none, and whole millimetres.
    pub fn depth(&self, moment: &Moment, seed: u64) -> DepthImage {
        let clean = self.clean_depth(moment);
        let (width, height) = (self.camera.width() as usize, self.camera.height() as usize);
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
        let errors: Vec<f64> = (0..clean.len()).map(|_| normal()).collect();
        let measured = (0..clean.len()).map(|at| {
            let (column, row) = (at % width, at / width);
            let right = clean[row * width + (column + 1).min(width - 1)];
            let below = clean[(row + 1).min(height - 1) * width + column];
            let z = clean[at];
            let is_jump = (z - right).abs().max((z - below).abs()) > 0.02;
            let draw: f64 = rng.random();
            let z = match draw {
                d if is_jump && d < HOLES => return 0.0,
                d if is_jump && d < 2.0 * HOLES => right,
                d if d > 1.0 - DROPPED => return 0.0,
                _ => z,
            };
            let sigma = 0.0012 + 0.0019 * (z - 0.4).powi(2);
            ((z + sigma * errors[at]) * 1000.0).round() as f32 / 1000.0
        });
        DepthImage::new(width, height, measured.collect()).unwrap()
    }

    fn clean_depth(&self, moment: &Moment) -> Vec<f64> {
        let (width, height) = (self.camera.width() as usize, self.camera.height() as usize);
        let object = moment.pose.map(|pose| self.rendered(&pose));
        // The table stays where the object stood on it in the first place.
        let place = DVec3::new(0.0, 0.02, 0.62) - self.up() * self.height;
        let mut depth: Vec<f64> = (0..width * height)
            .map(|at| {
                let (u, v) = ((at % width) as f64 + 0.5, (at / width) as f64 + 0.5);
                let ray = self.camera.ray_in_camera(u, v);
                let table = self.table.map(|up| up.dot(place) / up.dot(ray)).filter(|z| *z > 0.0);
                let ground = table.map_or(WALL, |z| z.min(WALL));
                // A box on the table, as a plane that stands upright.
                let aside = DVec3::new(0.2, 0.0, 0.62);
                let on_box = self.distractor && {
                    let p = ray * aside.z;
                    (p.x - aside.x).abs() < 0.04 && (p.y - aside.y).abs() < 0.05
                };
                if on_box { aside.z.min(ground) } else { ground }
            })
            .collect();
        if let Some(object) = &object {
            for (z, of_object) in depth.iter_mut().zip(object) {
                *z = z.min(f64::from(*of_object));
            }
        }
        if moment.hidden > 0.0 {
            let mut columns: Vec<usize> = match &object {
                Some(object) => (0..object.len())
                    .filter(|&at| object[at].is_finite())
                    .map(|at| at % width)
                    .collect(),
                None => vec![width * 2 / 3],
            };
            columns.sort_unstable();
            let last = (moment.hidden * columns.len() as f64) as usize;
            let border = columns.get(last).copied().unwrap_or(columns[columns.len() - 1] + 4);
            for (at, z) in depth.iter_mut().enumerate() {
                if at % width < border {
                    *z = z.min(BOARD);
                }
            }
        }
        depth
    }

    fn rendered(&self, pose: &Sim3) -> Vec<f32> {
        let points = self.mesh.vertices().iter().map(|&p| pose.apply(p)).collect();
        let placed = Mesh::new(points, self.mesh.faces().to_vec()).unwrap();
        let settings = RenderSettings { supersampling: 1, ..Default::default() };
        let cameras = [self.camera];
        let task = Task::default();
        let mut views = render(&placed, &SurfaceColor::GREY, &cameras, &settings, &task).unwrap();
        views.remove(0).depth
    }

    /// Mean distance of the surface of one pose to that of another, metres, each point to the nearest.
    pub fn surface_error(&self, found: &Sim3, truth: &Sim3) -> f64 {
        let back = truth.inverse() * *found;
        let every = (self.mesh.n_vertices() / 200).max(1);
        let points = self.mesh.vertices().iter().step_by(every);
        let distances: Vec<f64> = points
            .filter_map(|&p| self.surface.closest(back.apply(p)))
            .map(|hit| hit.distance)
            .collect();
        distances.iter().sum::<f64>() / distances.len().max(1) as f64
    }

    /// Whether a pose is right: its surface within a tenth of the diameter in the mean.
    pub fn is_right(&self, found: &Sim3, truth: Option<&Sim3>) -> bool {
        truth.is_some_and(|truth| self.surface_error(found, truth) < 0.1 * self.diameter())
    }

    /// Distance of the middles, metres, and angle, radians.
    pub fn errors(&self, found: &Sim3, truth: &Sim3) -> [f64; 2] {
        let shift = found.apply(self.centre).distance(truth.apply(self.centre));
        [shift, found.rotation.angle_between(truth.rotation)]
    }
}

/// What happens in a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Script {
    Still,
    /// Up to 1.2 cm and 2° a frame.
    Moving,
    /// A board comes from the left up to a share and goes.
    Hidden(f64),
    /// Pushed by 10 cm and 40° between two frames.
    Pushed,
    /// Taken away, and put back elsewhere, turned by 90°.
    Removed,
    /// Taken away behind the board.
    Stolen,
}

/// Frames of a run.
pub const FRAMES: usize = 60;

impl Script {
    pub fn name(self) -> String {
        match self {
            Self::Hidden(share) => format!("hidden {:.0} %", 100.0 * share),
            other => format!("{other:?}").to_lowercase(),
        }
    }

    /// What stands where in a frame of a scene whose object has a rotation at first.
    pub fn moment(self, scene: &Scene, rotation: DQuat, frame: usize) -> Moment {
        let first = DVec3::new(-0.03, 0.02, 0.62);
        let turned =
            |degrees: f64| DQuat::from_axis_angle(scene.up(), degrees.to_radians()) * rotation;
        let at = |shift: DVec3, degrees: f64| Some(scene.pose(first + shift, turned(degrees)));
        let still = Moment { pose: at(DVec3::ZERO, 0.0), hidden: 0.0 };
        let t = frame as f64 / FRAMES as f64;
        // Up from a quarter of the run on, down from three quarters on.
        let ramp = ((t - 0.2) / 0.2).min((0.9 - t) / 0.2).clamp(0.0, 1.0);
        match self {
            Self::Still => still,
            Self::Moving => {
                let phase = std::f64::consts::TAU * t;
                let shift =
                    0.1 * phase.sin() * DVec3::X + 0.05 * (1.0 - phase.cos()) * scene.away();
                Moment { pose: at(shift, 20.0 * phase.sin()), hidden: 0.0 }
            }
            Self::Hidden(share) => Moment { hidden: share * ramp, ..still },
            Self::Pushed if frame >= 20 => {
                Moment { pose: at(DVec3::new(0.1, 0.0, 0.0), 40.0), hidden: 0.0 }
            }
            Self::Removed if (20..35).contains(&frame) => Moment::default(),
            Self::Removed if frame >= 35 => {
                Moment { pose: at(0.06 * DVec3::X + 0.06 * scene.away(), 90.0), hidden: 0.0 }
            }
            Self::Stolen if (10..30).contains(&frame) => {
                let pose = if frame < 15 { still.pose } else { None };
                Moment { pose, hidden: 1.0 }
            }
            Self::Stolen if frame >= 30 => Moment::default(),
            Self::Pushed | Self::Removed | Self::Stolen => still,
        }
    }
}
