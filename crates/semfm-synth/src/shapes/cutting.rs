//! Cutting tools; one holds the handle.

use std::f64::consts::PI;

use super::{Blueprint, Grip, grip, part};
use crate::sdf::{Arch, chain, rounded_box, tube, v};
use crate::seed::Draw;

const KINDS: [&str; 6] = ["knife", "saw", "cleaver", "dagger", "bowsaw", "sickle"];

pub(super) fn generate(kind: usize, draw: &mut Draw) -> Blueprint {
    let name = KINDS[kind];
    let (handle, radius) = (draw.between(0.35, 0.5), draw.between(0.05, 0.07));
    let bend = draw.between(-0.06, 0.06);
    let flatness = draw.between(0.6, 0.85);
    let blade = draw.between(0.7, 1.0);
    let y = v(0.0, 1.0, 0.0);
    let thin = 0.3;
    let mut parts = Vec::new();
    if matches!(name, "knife" | "dagger" | "cleaver" | "sickle") {
        let nodes: Vec<_> = (0..5)
            .map(|i| f64::from(i) / 4.0 - 1.0)
            .map(|t| v(t * handle, 0.0, bend * (PI * t).sin()))
            .collect();
        let radii = [1.1, 0.95, 1.05, 0.95, 0.9].map(|r| r * radius);
        parts.push(grip("handle", chain(nodes, radii).flat(y, flatness), Grip::Always));
    }
    match name {
        "knife" => {
            let nodes = [v(0.05, 0.0, -0.01), v(0.5 * blade, 0.0, -0.01), v(blade, 0.0, 0.04)];
            parts.push(part("blade", chain(nodes, [0.09, 0.1, 0.015]).flat(y, thin)));
            parts
                .push(part("guard", rounded_box(v(0.02, 0.0, -0.01), v(0.035, 0.05, 0.085), 0.02)));
        }
        "dagger" => {
            let nodes = [v(0.05, 0.0, 0.0), v(0.6 * blade, 0.0, 0.0), v(blade, 0.0, 0.0)];
            parts.push(part("blade", chain(nodes, [0.075, 0.065, 0.01]).flat(y, 0.4)));
            parts.push(part("guard", tube([v(0.0, 0.0, -0.2), v(0.0, 0.0, 0.2)], 0.04)));
        }
        "cleaver" => {
            let centre = v(0.3 * blade + 0.05, 0.0, -0.07);
            parts.push(part("blade", rounded_box(centre, v(0.32 * blade, 0.025, 0.16), 0.02)));
            parts.push(part("guard", rounded_box(v(0.0, 0.0, 0.0), v(0.03, 0.05, 0.07), 0.02)));
        }
        "sickle" => {
            let sweep = PI / 2.0 + draw.between(0.0, 0.5);
            let nodes = Arch::new(v(0.1, 0.0, 0.35), 0.36, -PI / 2.0, sweep, 10).points();
            let radii: Vec<f64> = (0..10).map(|i| 0.06 - 0.045 * f64::from(i) / 9.0).collect();
            parts.push(part("blade", chain(nodes, radii).flat(y, thin)));
            parts.push(part("guard", rounded_box(v(0.02, 0.0, 0.0), v(0.04, 0.05, 0.06), 0.02)));
        }
        "saw" => {
            let plate = chain([v(0.08, 0.0, 0.0), v(1.2 * blade, 0.0, 0.06)], [0.17, 0.06]);
            parts.push(part("blade", plate.flat(y, 0.15)));
            parts.push(part("guard", rounded_box(v(0.03, 0.0, 0.0), v(0.05, 0.045, 0.14), 0.02)));
            let loop_ = [
                v(-0.02, 0.0, 0.14),
                v(-0.2, 0.0, 0.16),
                v(-0.27, 0.0, 0.05),
                v(-0.22, 0.0, -0.14),
                v(-0.02, 0.0, -0.13),
            ];
            parts.push(grip("handle", tube(loop_, 0.045), Grip::Always));
        }
        _ => {
            let end = v(1.3 * blade, 0.0, 0.0);
            parts.push(part("blade", tube([v(0.0, 0.0, 0.0), end], 0.03).flat(y, 0.9)));
            let bow = [v(0.0, 0.0, 0.0), v(0.1, 0.0, 0.28), v(0.9 * blade, 0.0, 0.3), end];
            parts.push(part("guard", tube(bow, 0.035)));
            let nodes = [v(-0.02, 0.0, 0.0), v(-0.2, 0.0, -0.02), v(-0.4, 0.0, -0.08)];
            parts.push(grip("handle", chain(nodes, [0.055, 0.065, 0.06]), Grip::Always));
        }
    }
    Blueprint { kind: name, parts, blend: 0.04 }
}
