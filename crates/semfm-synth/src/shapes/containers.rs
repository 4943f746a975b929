//! Water containers with a handle; one holds the handle.

use std::f64::consts::PI;

use super::{Blueprint, Grip, grip, part};
use crate::sdf::{Arch, chain, ellipsoid, revolve, tube, v};
use crate::seed::Draw;

const KINDS: [&str; 6] = ["mug", "kettle", "jug", "bottle", "teapot", "can"];

pub(super) fn generate(kind: usize, draw: &mut Draw) -> Blueprint {
    let name = KINDS[kind];
    let mut parts = Vec::new();
    match name {
        "mug" | "can" => {
            let (h, r) = (draw.between(0.5, 0.75), draw.between(0.24, 0.33));
            let foot = r * draw.between(0.8, 1.0);
            parts.push(part("body", revolve(&[(0.0, foot), (h, r)], Some(0.06), 2.0)));
            let reach = draw.between(0.16, 0.22);
            let bow =
                Arch::new(v(r - 0.01, 0.0, 0.5 * h), reach, -PI / 2.0 + 0.1, PI / 2.0 - 0.1, 8);
            let mut nodes = bow.stretch(1.0, 1.6 * h).points();
            let spread = nodes.iter().map(|p| (p.z - 0.5 * h).abs()).fold(0.0, f64::max);
            let squeeze = (0.38 * h / spread).min(1.0);
            nodes.iter_mut().for_each(|p| p.z = 0.5 * h + (p.z - 0.5 * h) * squeeze);
            parts.push(grip("handle", tube(nodes, 0.04), Grip::Always));
            if name == "can" {
                let spout = [v(-0.9 * r, 0.0, 0.25 * h), v(-r - 0.35, 0.0, 0.95 * h)];
                parts.push(part("spout", chain(spout, [0.06, 0.04])));
                parts.push(part("lid", revolve(&[(h - 0.03, r), (h + 0.03, 0.7 * r)], None, 2.0)));
            }
        }
        "kettle" => {
            let (r, h) = (draw.between(0.32, 0.4), draw.between(0.42, 0.55));
            parts.push(part(
                "body",
                revolve(&[(0.0, r), (0.35 * h, 1.02 * r), (h, 0.55 * r)], None, 2.0),
            ));
            parts.push(part("lid", ellipsoid(v(0.0, 0.0, h + 0.02), v(0.16, 0.16, 0.07))));
            let spout = [
                v(-0.8 * r, 0.0, 0.4 * h),
                v(-r - 0.15, 0.0, 0.75 * h),
                v(-r - 0.22, 0.0, 0.95 * h),
            ];
            parts.push(part("spout", chain(spout, [0.08, 0.055, 0.045])));
            let bow = Arch::new(v(0.0, 0.0, 0.75 * h), 0.8 * r, 0.15, PI - 0.15, 10);
            let bow = bow.stretch(1.0, draw.between(0.95, 1.2));
            parts.push(grip("handle", tube(bow.points(), 0.042), Grip::Along(0.1, 0.9)));
        }
        "jug" => {
            let (h, r) = (draw.between(0.75, 0.95), draw.between(0.26, 0.32));
            let profile = [(0.0, 0.8 * r), (0.3 * h, r), (0.75 * h, 0.6 * r), (h, 0.7 * r)];
            parts.push(part("body", revolve(&profile, Some(0.06), 2.0)));
            let spout = [v(-0.62 * r, 0.0, h - 0.06), v(-0.95 * r, 0.0, h + 0.02)];
            parts.push(part("spout", chain(spout, [0.07, 0.04])));
            let ear = [
                v(0.62 * r, 0.0, 0.92 * h),
                v(r + 0.16, 0.0, 0.9 * h),
                v(r + 0.17, 0.0, 0.6 * h),
                v(0.9 * r, 0.0, 0.32 * h),
            ];
            parts.push(grip("handle", tube(ear, 0.042), Grip::Always));
        }
        "bottle" => {
            let (h, r) = (draw.between(0.9, 1.15), draw.between(0.18, 0.24));
            let profile = [(0.0, r), (0.6 * h, r), (0.78 * h, 0.45 * r), (0.9 * h, 0.42 * r)];
            parts.push(part("body", revolve(&profile, None, draw.between(2.0, 3.5))));
            parts.push(part("lid", revolve(&[(0.88 * h, 0.52 * r), (h, 0.5 * r)], None, 2.0)));
            let ear = [
                v(0.42 * r, 0.0, 0.84 * h),
                v(r + 0.1, 0.0, 0.8 * h),
                v(r + 0.12, 0.0, 0.55 * h),
                v(0.9 * r, 0.0, 0.42 * h),
            ];
            parts.push(grip("handle", tube(ear, 0.038), Grip::Always));
        }
        _ => {
            let r = draw.between(0.28, 0.34);
            parts.push(part("body", ellipsoid(v(0.0, 0.0, 0.25), v(r, r, 0.25))));
            parts.push(part("lid", ellipsoid(v(0.0, 0.0, 0.49), v(0.15, 0.15, 0.06))));
            parts.push(part("lid", ellipsoid(v(0.0, 0.0, 0.57), v(0.05, 0.05, 0.05))));
            let spout = [v(-0.8 * r, 0.0, 0.2), v(-r - 0.14, 0.0, 0.28), v(-r - 0.25, 0.0, 0.46)];
            parts.push(part("spout", chain(spout, [0.09, 0.06, 0.04])));
            let reach = draw.between(0.14, 0.19);
            let mut ear = vec![v(0.6 * r, 0.0, 0.1)];
            ear.extend(
                Arch::new(v(0.95 * r, 0.0, 0.28), reach, -PI / 2.0 + 0.1, PI / 2.0 - 0.1, 8)
                    .points(),
            );
            ear.push(v(0.55 * r, 0.0, 0.42));
            parts.push(grip("handle", tube(ear, 0.04), Grip::Along(0.14, 0.86)));
        }
    }
    Blueprint { kind: name, parts, blend: 0.04 }
}
