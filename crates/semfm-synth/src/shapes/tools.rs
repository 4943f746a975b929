//! Tools with handles; one holds the handle, short of the head.

use std::f64::consts::{PI, TAU};

use super::{Blueprint, Grip, grip, part};
use crate::sdf::{Arch, chain, rounded_box, tube, v};
use crate::seed::Draw;

const KINDS: [&str; 6] = ["hammer", "pickaxe", "wrench", "axe", "mallet", "clawhammer"];

pub(super) fn generate(kind: usize, draw: &mut Draw) -> Blueprint {
    let length = draw.between(0.8, 1.4);
    let radius = draw.between(0.045, 0.075);
    let bend = draw.between(-0.12, 0.12);
    let waves = draw.between(0.6, 1.3);
    let held = draw.between(0.7, 0.85);
    let flatness = draw.between(0.55, 0.9);
    let y = v(0.0, 1.0, 0.0);
    let heights: Vec<f64> = (0..7).map(|i| f64::from(i) / 6.0).collect();
    let nodes: Vec<_> = heights.iter().map(|h| v(bend * (PI * h).sin(), 0.0, h * length)).collect();
    let radii: Vec<f64> =
        heights.iter().map(|h| radius * (1.0 + 0.25 * (TAU * h * waves).cos())).collect();
    let handle = chain(nodes, radii).flat(y, flatness);
    let mut parts = vec![grip("handle", handle, Grip::Along(0.0, held))];
    let top = v(0.0, 0.0, length);
    match KINDS[kind] {
        "hammer" => {
            let a = draw.between(0.16, 0.26);
            parts.push(part(
                "head",
                chain([top + v(-a, 0.0, 0.0), top + v(0.6 * a, 0.0, 0.0)], [0.11, 0.085]),
            ));
            let claw =
                chain([top + v(0.6 * a, 0.0, 0.0), top + v(1.5 * a, 0.0, -0.03)], [0.07, 0.03]);
            parts.push(part("claw", claw.flat(v(0.0, 0.0, 1.0), 0.7)));
        }
        "pickaxe" => {
            let (a, s) = (draw.between(0.4, 0.6), draw.between(0.08, 0.2));
            parts.push(part(
                "head",
                tube([top + v(-0.08, 0.0, 0.0), top + v(0.08, 0.0, 0.0)], 0.085),
            ));
            for (side, tip) in [(1.0, 0.015), (-1.0, 0.025)] {
                let nodes = [
                    top + v(side * 0.08, 0.0, 0.0),
                    top + v(side * 0.5 * a, 0.0, -0.3 * s),
                    top + v(side * a, 0.0, -s),
                ];
                let spike = chain(nodes, [0.07, 0.055, tip]);
                parts.push(part("claw", if side < 0.0 { spike.flat(y, 0.8) } else { spike }));
            }
        }
        "wrench" => {
            let r = draw.between(0.13, 0.18);
            let jaw = Arch::new(top + v(0.0, 0.0, 0.9 * r), r, -PI / 2.0 - 1.9, -PI / 2.0 + 1.9, 9);
            parts.push(part("head", tube(jaw.points(), 0.055).flat(y, 0.7)));
            if draw.between(0.0, 1.0) < 0.5 {
                let ring = Arch::new(v(0.0, 0.0, -0.1), 0.09, 0.0, TAU, 9);
                parts.push(part("claw", tube(ring.points(), 0.035).flat(y, 0.7)));
            }
        }
        "axe" => {
            let (w, h) = (draw.between(0.25, 0.38), draw.between(0.12, 0.2));
            let poll =
                chain([top + v(-0.07, 0.0, 0.0), top + v(0.5 * w, 0.0, -0.02)], [0.085, 0.1]);
            parts.push(part("head", poll.flat(y, 0.6)));
            let edge = [top + v(w, 0.0, h), top + v(1.05 * w, 0.0, 0.0), top + v(w, 0.0, -h)];
            parts.push(part("claw", tube(edge, 0.05).flat(y, 0.5)));
            let cheek = chain([top + v(0.5 * w, 0.0, 0.0), top + v(w, 0.0, 0.0)], [0.1, 0.13]);
            parts.push(part("claw", cheek.flat(y, 0.35)));
        }
        "mallet" => {
            parts.push(part("head", rounded_box(top, v(draw.between(0.2, 0.3), 0.12, 0.13), 0.04)));
        }
        _ => {
            let a = draw.between(0.17, 0.24);
            parts.push(part(
                "head",
                chain([top + v(-a, 0.0, 0.0), top + v(0.08, 0.0, 0.0)], [0.1, 0.075]),
            ));
            for side in [-1.0, 1.0] {
                let nodes = [
                    top + v(0.06, side * 0.03, 0.0),
                    top + v(0.22, side * 0.055, -0.01),
                    top + v(0.33, side * 0.07, -0.1),
                ];
                parts.push(part("claw", chain(nodes, [0.05, 0.04, 0.015])));
            }
        }
    }
    Blueprint { kind: KINDS[kind], parts, blend: 0.05 }
}
