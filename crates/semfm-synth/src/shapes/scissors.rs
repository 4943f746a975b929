//! Scissor-type tools; one holds both handles.

use std::f64::consts::TAU;

use super::{Blueprint, Grip, grip, part};
use crate::sdf::{Arch, chain, tube, v};
use crate::seed::Draw;

const KINDS: [&str; 6] = ["scissors", "shears", "cutter", "bolt", "snips", "kids"];

pub(super) fn generate(kind: usize, draw: &mut Draw) -> Blueprint {
    let name = KINDS[kind];
    let opening = draw.between(0.15, 0.45);
    let blade = match name {
        "scissors" => draw.between(0.55, 0.75),
        "shears" => draw.between(0.5, 0.7),
        "cutter" => 0.18,
        "bolt" => 0.2,
        "snips" => 0.3,
        _ => draw.between(0.35, 0.45),
    };
    let width = match name {
        "cutter" | "bolt" => 0.09,
        "snips" => 0.075,
        _ => 0.055,
    };
    let (sin, cos) = (opening / 2.0).sin_cos();
    let y_axis = v(0.0, 1.0, 0.0);
    let mut parts = Vec::new();
    for side in [-1.0, 1.0] {
        let y = v(0.0, 0.02 * side, 0.0);
        let forward = v(cos, 0.0, side * sin);
        let nodes = [v(0.03, y.y, 0.0), 0.6 * blade * forward + y, blade * forward + y];
        parts.push(part("blade", chain(nodes, [width, 0.85 * width, 0.02]).flat(y_axis, 0.5)));
        let back = v(-cos, 0.0, side * sin);
        if matches!(name, "scissors" | "kids") {
            let (length, r) = (draw.between(0.25, 0.38), draw.between(0.1, 0.15));
            let shank = [y, length * back + v(0.0, y.y, 0.03 * side)];
            parts.push(part("shank", tube(shank, 0.04)));
            let centre = length * back + v(-0.9 * r, 0.0, side * 0.9 * r);
            let ring = Arch::new(centre, r, 0.0, TAU, 12).stretch(draw.between(1.0, 1.5), 1.0);
            let mut nodes = ring.points();
            nodes.pop();
            parts.push(grip("loop", tube(nodes, 0.035).closed(), Grip::Always));
        } else {
            let length = match name {
                "shears" => draw.between(0.6, 0.85),
                "cutter" => draw.between(0.45, 0.6),
                "bolt" => draw.between(0.8, 1.1),
                _ => draw.between(0.5, 0.65),
            };
            let out = v(0.0, 0.0, side) * draw.between(0.05, 0.14);
            let knee = 0.3 * length * back + out;
            let nodes = [knee, 0.7 * length * back + 1.1 * out, length * back + 0.3 * out];
            parts.push(part("shank", tube([y, knee], 0.045)));
            parts.push(grip("handle", chain(nodes, [0.05, 0.058, 0.05]), Grip::Along(0.1, 1.0)));
        }
    }
    parts.push(part("pivot", tube([v(0.0, -0.07, 0.0), v(0.0, 0.07, 0.0)], 0.06)));
    Blueprint { kind: name, parts, blend: 0.03 }
}
