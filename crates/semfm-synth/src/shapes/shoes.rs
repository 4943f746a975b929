//! Shoes; one holds the heel end of the collar.

use std::f64::consts::PI;

use super::{Blueprint, Grip, grip, part};
use crate::sdf::{Arch, Plane, chain, rounded_box, tube, v};
use crate::seed::Draw;

const KINDS: [&str; 6] = ["sneaker", "sandal", "heel", "boot", "slipper", "loafer"];

pub(super) fn generate(kind: usize, draw: &mut Draw) -> Blueprint {
    let name = KINDS[kind];
    let (length, w) = (draw.between(0.9, 1.15), draw.between(0.15, 0.19));
    let lift = match name {
        "heel" => draw.between(0.25, 0.38),
        "boot" => 0.06,
        "sandal" => 0.02,
        _ => draw.between(0.0, 0.04),
    };
    let (wiggle, flatness) = (draw.between(-0.03, 0.03), draw.between(0.3, 0.42));
    let along: Vec<f64> = (0..6).map(|i| f64::from(i) / 5.0).collect();
    let nodes: Vec<_> = along
        .iter()
        .map(|&t| {
            let rise = lift * (1.0 - 1.7 * t).clamp(0.0, 1.0).powf(1.3);
            v(t * length, wiggle * (PI * t).sin(), rise - 0.03)
        })
        .collect();
    let radii = [0.8, 0.85, 0.8, 1.0, 1.05, 0.7].map(|r| r * w);
    let mut parts = vec![part("sole", chain(nodes, radii).flat(v(0.0, 0.0, 1.0), flatness))];
    match name {
        "heel" => parts.push(part(
            "heel",
            chain([v(0.02, 0.0, lift - 0.05), v(0.0, 0.0, -0.12)], [0.09, 0.03]),
        )),
        "sandal" => {}
        _ => parts.push(part("heel", rounded_box(v(0.06, 0.0, -0.08), v(0.13, 0.11, 0.045), 0.03))),
    }
    if name == "sandal" {
        let x = v(1.0, 0.0, 0.0);
        let front = Arch::new(v(0.72 * length, 0.0, 0.02), w, 0.1, PI - 0.1, 9)
            .plane(Plane::Yz)
            .stretch(1.0, draw.between(0.7, 1.0));
        parts.push(part("toe", tube(front.points(), 0.035).flat(x, 2.2)));
        let middle = Arch::new(v(0.5 * length, 0.0, 0.02), 0.9 * w, 0.1, PI - 0.1, 9)
            .plane(Plane::Yz)
            .stretch(1.0, 1.1);
        parts.push(part("toe", tube(middle.points(), 0.035).flat(x, 1.8)));
        let mut strap = vec![v(0.35 * length, 0.8 * w, 0.0)];
        let back = Arch::new(v(0.16, 0.0, 0.2), 0.15, PI / 2.0, 3.0 * PI / 2.0, 7).plane(Plane::Xy);
        strap.extend(back.points());
        strap.push(v(0.35 * length, -0.8 * w, 0.0));
        let strap = tube(strap, 0.035).flat(v(0.0, 0.0, 1.0), 1.6);
        parts.push(grip("collar", strap, Grip::Along(0.12, 0.88)));
    } else {
        upper(name, length, w, lift, draw, &mut parts);
    }
    Blueprint { kind: name, parts, blend: 0.05 }
}

/// Toe cap, collar and tongue of everything that is not a sandal.
fn upper(
    name: &str,
    length: f64,
    w: f64,
    lift: f64,
    draw: &mut Draw,
    parts: &mut Vec<super::Part>,
) {
    let top = match name {
        "boot" => draw.between(0.5, 0.75),
        "heel" => draw.between(0.12, 0.16),
        "slipper" => 0.1,
        _ => draw.between(0.2, 0.3),
    };
    let cap = [
        v(0.45 * length, 0.0, 0.08 + 0.3 * lift),
        v(0.7 * length, 0.0, 0.06),
        v(0.9 * length, 0.0, 0.04),
    ];
    let cap =
        chain(cap, [0.95 * w, 1.02 * w, 0.7 * w]).flat(v(0.0, 0.0, 1.0), draw.between(0.6, 0.85));
    parts.push(part("toe", cap));
    if name == "slipper" {
        let pad = chain([v(0.02, 0.0, 0.02), v(0.01, 0.0, 0.1)], [0.75 * w, 0.7 * w]);
        parts.push(grip("collar", pad.flat(v(1.0, 0.0, 0.0), 0.5), Grip::Always));
        return;
    }
    let (x, r) = (0.2, 1.02 * w);
    // What the foot goes into, from two heights on.
    let [opening, tongue_opening] = [0.05, 0.06].map(|bottom| {
        let axis = [v(x, 0.0, lift + bottom), v(x + 0.03, 0.0, lift + top + 0.4)];
        chain(axis, [0.62 * r, 0.66 * r]).field()
    });
    let flare = draw.between(0.85, 1.05);
    let shell = chain([v(x, 0.0, lift + 0.02), v(x + 0.02, 0.0, lift + top)], [r, r * flare])
        .field()
        .minus(opening)
        .below(v(x, 0.0, lift + top), v(0.1, 0.0, 1.0));
    parts.push(grip("collar", shell, Grip::XBelow(x + 0.02 * draw.between(0.95, 1.15))));
    if name != "heel" {
        let nodes = [v(x + 0.05, 0.0, 0.8 * lift + 0.05), v(0.48 * length, 0.0, 0.1 + 0.3 * lift)];
        parts.push(part("tongue", chain(nodes, [0.9 * r, 0.9 * w]).field().minus(tongue_opening)));
    }
}
