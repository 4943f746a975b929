//! Draws a gripper closed and open, in front and from the side, as SVG: what a grasp's collision check
//! sees. `cargo run -p semfm-show --example draw_gripper -- franka gripper.svg`
#![allow(clippy::print_stderr, missing_docs)]

use std::fmt::Write;

use parry3d_f64::math::Pose;
use parry3d_f64::shape::{Shape, TypedShape};
use semfm::geom::io::write_atomically;
use semfm::geom::math::DVec3;
use semfm::robot::{BuiltinGripper, Gripper, GripperPart, GripperSettings, PosedPart, Role};
use semfm_show::html::escape;

/// Pixels per metre.
const SCALE: f64 = 1500.0;
/// Width and height of a panel, metres.
const PANEL: [f64; 2] = [0.26, 0.3];
/// Height of the origin in a panel, from its top, metres.
const ABOVE: f64 = 0.075;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [name, picture] = arguments.as_slice() else {
        let names = BuiltinGripper::names();
        eprintln!("usage: draw_gripper NAME|ROBOT.urdf PICTURE.svg, NAME being one of {names}");
        std::process::exit(2);
    };
    let gripper = Gripper::open(name, &GripperSettings::default())?;
    gripper.notes.iter().for_each(|note| eprintln!("{note}"));
    let svg = draw(&gripper)?;
    write_atomically(picture, |file| file.write_all(svg.as_bytes()))?;
    Ok(())
}

fn draw(gripper: &Gripper) -> Result<String, std::fmt::Error> {
    let [width, height] = PANEL.map(|side| side * SCALE);
    let mut svg = String::new();
    writeln!(
        svg,
        r##"<svg xmlns="http://www.w3.org/2000/svg" width="{0}" height="{1}" viewBox="0 0 {0} {1}" font-family="sans-serif" font-size="18"><rect width="100%" height="100%" fill="#fff"/>"##,
        4.0 * width,
        height
    )?;
    let (closed, open) = (*gripper.opening.start(), *gripper.opening.end());
    writeln!(svg, r##"<text x="14" y="{}">{}</text>"##, height - 14.0, escape(&gripper.name))?;
    let views = [(closed, true), (open, true), (closed, false), (open, false)];
    for (panel, (opening, front)) in views.into_iter().enumerate() {
        let across = if front { "y" } else { "x" };
        writeln!(
            svg,
            r##"<g transform="translate({} 0)"><text x="14" y="26">{:.1} mm apart ({across} right, z up)</text>"##,
            panel as f64 * width,
            opening * 1e3
        )?;
        for PosedPart { tcp_from_part, part } in gripper.parts_at(opening) {
            polygon(&mut svg, &tcp_from_part, part, front)?;
        }
        pads(&mut svg, gripper, opening, front)?;
        svg.push_str("</g>\n");
    }
    Ok(svg + "</svg>\n")
}

/// A part's silhouette: the hull of its projected corners.
fn polygon(svg: &mut String, pose: &Pose, part: &GripperPart, front: bool) -> std::fmt::Result {
    let colour = match part.role {
        Role::Palm => "#7f8c8d",
        Role::Left => "#2e86c1",
        Role::Right => "#ca6f1e",
    };
    let flat: Vec<[f64; 2]> = corners(&*part.shape)
        .into_iter()
        .map(|corner| pixel(pose.transform_point(corner), front))
        .collect();
    let points: Vec<String> = outline(flat).iter().map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
    writeln!(
        svg,
        r##"<polygon points="{}" fill="{colour}" fill-opacity="0.35" stroke="{colour}"/>"##,
        points.join(" ")
    )
}

/// The pads' faces and the origin.
fn pads(svg: &mut String, gripper: &Gripper, opening: f64, front: bool) -> std::fmt::Result {
    let [x, z] = gripper.pad.map(|side| side / 2.0);
    for side in [-1.0, 1.0] {
        let y = side * opening / 2.0;
        let [ax, ay] = pixel(DVec3::new(-x, y, -z), front);
        let [bx, by] = pixel(DVec3::new(x, y, z), front);
        // Seen from its edge a pad is a line, which a polygon draws and a rectangle does not.
        writeln!(
            svg,
            r##"<polygon points="{ax:.1},{ay:.1} {bx:.1},{ay:.1} {bx:.1},{by:.1} {ax:.1},{by:.1}" fill="none" stroke="#c0392b" stroke-width="2"/>"##
        )?;
    }
    let [x, y] = pixel(DVec3::ZERO, front);
    writeln!(svg, r##"<circle cx="{x:.1}" cy="{y:.1}" r="4" fill="#c0392b"/>"##)
}

fn pixel(point: DVec3, front: bool) -> [f64; 2] {
    let across = if front { point.y } else { point.x };
    [(across + PANEL[0] / 2.0) * SCALE, (ABOVE - point.z) * SCALE]
}

fn corners(shape: &dyn Shape) -> Vec<DVec3> {
    match shape.as_typed_shape() {
        TypedShape::Cuboid(cuboid) => cuboid.to_trimesh().0,
        TypedShape::ConvexPolyhedron(hull) => hull.points().to_vec(),
        TypedShape::Ball(ball) => ball.to_trimesh(24, 24).0,
        TypedShape::Cylinder(cylinder) => cylinder.to_trimesh(24).0,
        TypedShape::Capsule(capsule) => capsule.to_trimesh(24, 12).0,
        _ => Vec::new(),
    }
}

/// The convex outline of points in the plane (Andrew 1979, monotone chain).
fn outline(mut points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let mut outline = chain(points.iter().copied());
    outline.extend(chain(points.iter().rev().copied()));
    outline
}

/// One side of the outline, without its last point: every turn is to the left.
fn chain(points: impl Iterator<Item = [f64; 2]>) -> Vec<[f64; 2]> {
    let mut chain: Vec<[f64; 2]> = Vec::new();
    for p in points {
        while let [.., a, b] = chain.as_slice()
            && (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) <= 0.0
        {
            chain.pop();
        }
        chain.push(p);
    }
    chain.pop();
    chain
}
