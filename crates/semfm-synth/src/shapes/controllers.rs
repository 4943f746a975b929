//! Controllers; one holds the grips.

use std::f64::consts::PI;

use super::{Blueprint, Grip, Part, grip, part};
use crate::sdf::{chain, ellipsoid, rounded_box, tube, v};
use crate::seed::Draw;

const KINDS: [&str; 6] = ["gamepad", "remote", "retropad", "gamepad2", "longremote", "nunchuk"];

pub(super) fn generate(kind: usize, draw: &mut Draw) -> Blueprint {
    let name = KINDS[kind];
    let parts = match name {
        "gamepad" | "gamepad2" => gamepad(draw),
        "remote" => remote(draw.between(0.7, 0.9), draw),
        "longremote" => remote(draw.between(0.9, 1.3), draw),
        "retropad" => retropad(draw),
        _ => vec![
            grip(
                "grip",
                chain([v(-0.35, 0.0, -0.02), v(0.0, 0.0, 0.0)], [0.09, 0.12]),
                Grip::Always,
            ),
            part("body", chain([v(0.05, 0.0, 0.0), v(0.2, 0.0, 0.02)], [0.14, 0.12])),
            part("button", chain([v(0.2, 0.0, 0.1), v(0.2, 0.0, 0.22)], [0.04, 0.06])),
            part("button", ellipsoid(v(0.33, 0.0, 0.0), v(0.05, 0.06, 0.05))),
        ],
    };
    Blueprint { kind: name, parts, blend: 0.04 }
}

/// The cross-shaped pad around `x`, `y`, at height `z`.
fn cross(x: f64, y: f64, z: f64, thickness: f64) -> [Part; 2] {
    [v(0.08, 0.025, thickness), v(0.025, 0.08, thickness)]
        .map(|half| part("pad", rounded_box(v(x, y, z), half, 0.01)))
}

fn gamepad(draw: &mut Draw) -> Vec<Part> {
    let w = draw.between(0.36, 0.46);
    let (spread, length) = (draw.between(0.1, 0.25), draw.between(0.28, 0.42));
    let mut parts = vec![part("body", rounded_box(v(0.0, 0.0, 0.0), v(w, 0.2, 0.08), 0.06))];
    for side in [-1.0, 1.0] {
        let horn = [
            v(side * 0.85 * w, 0.0, -0.01),
            v(side * (w + 0.6 * spread), -0.6 * length, -0.05),
            v(side * (w + spread), -length, -0.09),
        ];
        parts.push(grip("grip", chain(horn, [0.13, 0.105, 0.075]), Grip::Along(0.3, 1.0)));
        let stick = [v(side * 0.45 * w, -0.08, 0.06), v(side * 0.45 * w, -0.08, 0.16)];
        parts.push(part("button", chain(stick, [0.04, 0.055])));
    }
    for k in 0..4 {
        let (sin, cos) = (f64::from(k) * PI / 2.0).sin_cos();
        let centre = v(0.75 * w + 0.07 * cos, 0.08 + 0.07 * sin, 0.09);
        parts.push(part("button", ellipsoid(centre, v(0.028, 0.028, 0.04))));
    }
    parts.extend(cross(-0.75 * w, 0.08, 0.09, 0.025));
    parts
}

fn remote(length: f64, draw: &mut Draw) -> Vec<Part> {
    let (w, thickness) = (draw.between(0.12, 0.17), draw.between(0.06, 0.1));
    let half = v(0.25 * length, 0.95 * w, thickness);
    let mut parts = vec![
        grip("grip", rounded_box(v(-0.25 * length, 0.0, 0.0), half, 0.05), Grip::Along(0.0, 0.9)),
        part("body", rounded_box(v(0.25 * length, 0.0, 0.0), v(0.27 * length, w, 0.065), 0.05)),
    ];
    for row in 0..3 {
        for side in [-1.0, 0.0, 1.0] {
            let centre = v(length * (0.08 + 0.1 * f64::from(row)), side * 0.5 * w, 0.065);
            parts.push(part("button", ellipsoid(centre, v(0.03, 0.03, 0.035))));
        }
    }
    parts.push(part("pad", ellipsoid(v(0.42 * length, 0.0, 0.06), v(0.08, 0.08, 0.035))));
    parts
}

fn retropad(draw: &mut Draw) -> Vec<Part> {
    let w = draw.between(0.45, 0.55);
    let mut parts = vec![part("body", rounded_box(v(0.0, 0.0, 0.0), v(0.6 * w, 0.2, 0.07), 0.04))];
    for side in [-1.0, 1.0] {
        let r = draw.between(0.17, 0.2);
        let end = tube([v(side * 0.75 * w, 0.03, 0.0), v(side * 0.75 * w, -0.05, 0.0)], r);
        parts.push(grip("grip", end.flat(v(0.0, 0.0, 1.0), 0.5), Grip::Always));
    }
    parts.extend(cross(-0.55 * w, 0.0, 0.09, 0.03));
    for side in [-1.0, 1.0] {
        let centre = v(0.5 * w + side * 0.06, side * 0.05, 0.08);
        parts.push(part("button", ellipsoid(centre, v(0.04, 0.04, 0.04))));
    }
    parts
}
