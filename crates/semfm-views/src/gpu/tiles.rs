//! What is drawn together: the rectangles of some views that the object fills, one below the other.

use std::ops::Range;

use rayon::prelude::*;
use semfm_geom::{Intrinsics, Pinhole};

use super::device::Device;
use super::render_target::{COLOR_BYTES, Extent, ID_BYTES, padded};
use crate::render::Request;
use crate::render::triangle::Projection;

/// Bytes of views that one batch brings back: on a graphics processor enough that handing over costs
/// little, and little enough that the next batch is drawn while this one is read.
const BATCH_BYTES: u64 = 8 << 20;

/// The same for a driver that draws on the CPU. There a batch that outgrows the caches costs more than
/// handing it over: on lavapipe 14 views at 224 px took a fifth less time in six batches than in one.
const BATCH_BYTES_ON_CPU: u64 = 1 << 19;

/// Bytes of one tile's samples, eight each: a view that has more is cut.
const TILE_BYTES: u64 = 256 << 20;

/// Pixels around the object, since a driver rounds the corners' places.
const MARGIN: usize = 1;

/// A rectangle of a view, and its place in a batch.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tile {
    /// Index of the view.
    pub view: usize,
    /// Columns and rows of its pixels.
    pub columns: Range<usize>,
    pub rows: Range<usize>,
    /// Rows above it in the batch.
    pub top: usize,
}

impl Tile {
    /// The camera that sees this tile alone.
    pub fn camera(&self, whole: &Pinhole) -> Pinhole {
        let intrinsics = Intrinsics {
            width: self.columns.len() as u32,
            height: self.rows.len() as u32,
            cx: whole.cx() - self.columns.start as f64,
            cy: whole.cy() - self.rows.start as f64,
            ..whole.intrinsics()
        };
        Pinhole::with_pixel_centres_at_half(intrinsics, whole.camera_from_world())
            .expect("a tile has pixels and its camera the numbers of a sound one")
    }
}

/// Tiles one below the other, their left sides aligned.
pub(super) fn extent(batch: &[Tile]) -> Extent {
    let width = batch.iter().map(|tile| tile.columns.len()).max().unwrap_or(0);
    let height = batch.last().map_or(0, |tile| tile.top + tile.rows.len());
    Extent { width: width as u32, height: height as u32 }
}

/// The batches that draw all views and bring back `scale` values along each side of a pixel. What no
/// triangle can reach is in none; what is larger than the driver's textures, or than a tile may be,
/// is in several.
pub(super) fn batches(
    device: &Device,
    request: &Request<'_>,
    cameras: &[Pinhole],
    scale: u32,
) -> Vec<Vec<Tile>> {
    let windows: Vec<[Range<usize>; 2]> =
        cameras.par_iter().map(|camera| window(request, camera)).collect();
    let limits = device.device.limits();
    let side = (limits.max_texture_dimension_2d / request.settings.supersampling).max(1) as usize;
    let on_cpu = device.adapter.device_type == wgpu::DeviceType::Cpu;
    let batch = if on_cpu { BATCH_BYTES_ON_CPU } else { BATCH_BYTES };
    let values_per_pixel = u64::from(scale * scale);
    let samples_per_pixel = u64::from(request.settings.supersampling.pow(2));
    let most = limits.max_buffer_size / values_per_pixel;
    let tile = (TILE_BYTES / samples_per_pixel).min(most);
    let batch = (batch / values_per_pixel).min(tile);
    pack(&windows, side, batch, tile)
}

fn window(request: &Request<'_>, camera: &Pinhole) -> [Range<usize>; 2] {
    let [columns, rows] = Projection::new(&request.ordered, camera).window();
    [with_margin(columns, camera.width()), with_margin(rows, camera.height())]
}

/// A range of pixels with its [`MARGIN`], within an image's side.
fn with_margin(pixels: Range<usize>, side: u32) -> Range<usize> {
    if pixels.is_empty() {
        return pixels;
    }
    pixels.start.saturating_sub(MARGIN)..(pixels.end + MARGIN).min(side as usize)
}

/// Cuts windows to tiles of at most `side` pixels along each side and `tile_bytes`, and puts them in
/// order into batches of like size: tiles one below the other, no more than `batch_bytes` of them
/// unless a tile alone has more. Every batch counts as wide as the widest tile.
fn pack(
    windows: &[[Range<usize>; 2]],
    side: usize,
    batch_bytes: u64,
    tile_bytes: u64,
) -> Vec<Vec<Tile>> {
    let widest = windows.iter().map(|[columns, _]| columns.len()).max().unwrap_or(0).min(side);
    let row = bytes_of_row(widest).max(1);
    let all: u64 = windows.iter().map(|[_, rows]| rows.len() as u64 * row).sum();
    let alike = all.div_ceil(all.div_ceil(batch_bytes.max(1)).max(1));
    let [batch_rows, tile_rows] =
        [alike, tile_bytes].map(|bytes| (bytes / row).clamp(1, side as u64) as usize);
    let mut batches: Vec<Vec<Tile>> = Vec::new();
    for (view, [columns, rows]) in windows.iter().enumerate() {
        for left in columns.clone().step_by(side) {
            let columns = left..columns.end.min(left + side);
            for first in rows.clone().step_by(tile_rows) {
                let rows = first..rows.end.min(first + tile_rows);
                let top = batches.last().map_or(0, |batch| extent(batch).height as usize);
                let tile = Tile { view, columns: columns.clone(), rows, top };
                match batches.last_mut().filter(|_| top + tile.rows.len() <= batch_rows) {
                    Some(batch) => batch.push(tile),
                    None => batches.push(vec![Tile { top: 0, ..tile }]),
                }
            }
        }
    }
    batches
}

fn bytes_of_row(width: usize) -> u64 {
    u64::from(padded(width as u32, ID_BYTES.max(COLOR_BYTES)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pixel_of_every_window_is_in_one_part() {
        let windows = [[3..203, 5..105], [0..0, 0..0], [0..64, 0..1000], [10..11, 7..8]];
        for (side, batch, tile) in [
            (64, 1 << 20, 1 << 20),
            (1000, 50_000, 50_000),
            (4096, 1 << 19, 6 << 20),
            (1, 1, 1),
            (77, 2000, 8000),
        ] {
            let mut seen: Vec<_> = windows.iter().map(|_| vec![0u8; 300 * 1000]).collect();
            for tiles in pack(&windows, side, batch, tile) {
                let Extent { width, height } = extent(&tiles);
                assert!(width as usize <= side && height as usize <= side);
                let most = if tiles.len() == 1 { tile } else { batch };
                assert!(height == 1 || bytes_of_row(side.min(200)) * u64::from(height) <= most);
                let mut top = 0;
                for tile in &tiles {
                    assert_eq!(tile.top, top);
                    top += tile.rows.len();
                    for row in tile.rows.clone() {
                        for column in tile.columns.clone() {
                            seen[tile.view][row * 300 + column] += 1;
                        }
                    }
                }
            }
            for (seen, [columns, rows]) in seen.iter().zip(&windows) {
                let area: usize = seen.iter().map(|&n| usize::from(n)).sum();
                assert_eq!(area, columns.len() * rows.len());
                assert!(seen.iter().all(|&n| n <= 1));
            }
        }
    }
}
