//! Temporary.
use semfm_geom::{Mesh, Task, io::read_mesh};
use semfm_grasp::{GraspObject, GraspSettings, Grasps, Scene, Selection, find_grasps};
use semfm_robot::{Gripper, GripperSettings};
use std::fmt::Write as _;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // lines: mesh scale mass hand mode samples top diversity seed out
    let text = std::fs::read_to_string(std::env::args().nth(1).ok_or("list")?)?;
    for line in text.lines() {
        let w: Vec<&str> = line.split('\t').collect();
        let start = std::time::Instant::now();
        let mesh: Mesh = read_mesh(std::path::Path::new(w[0]))?.mesh;
        let scale: f64 = w[1].parse()?;
        let gripper = Gripper::open(w[3], &GripperSettings::default())?;
        let object = GraspObject::from_mesh(&mesh, scale)?;
        let settings = GraspSettings {
            mass: Some(w[2].parse()?),
            selection: if w[4] == "random" { Selection::Random } else { Selection::Best },
            n_samples: w[5].parse()?,
            top: w[6].parse()?,
            diversity: w[7].parse()?,
            seed: w[8].parse()?,
            ..GraspSettings::default()
        };
        let whole = vec![1.0; object.n_weights()];
        let found = find_grasps(&object, &whole, &gripper, &Scene::new(), &settings, &Task::default())?;
        std::fs::write(w[9], json(&mesh, scale, &gripper, &found))?;
        println!("{} {} {} survivors {:.1} s", w[0], w[3], found.n_survivors, start.elapsed().as_secs_f64());
    }
    Ok(())
}

fn json(mesh: &Mesh, scale: f64, gripper: &Gripper, found: &Grasps) -> String {
    let mut s = String::new();
    let _ = write!(s, "{{\"format\":\"semfm.grasps/1\",\"mesh\":{{\"n_vertices\":{},\"n_triangles\":{},\"hash\":\"{}\"}},\"object_scale\":{scale:?},\"gripper\":{{\"name\":\"{}\",\"pad\":{:?}}},\"n_survivors\":{},\"grasps\":[",
        mesh.n_vertices(), mesh.n_faces(), mesh.hash(), gripper.name, gripper.pad, found.n_survivors);
    for (i, g) in found.grasps.iter().enumerate() {
        let m = g.object_from_tcp.to_mat4().transpose().to_cols_array_2d();
        let p = g.object_from_tcp.translation.to_array();
        let c = g.contacts.map(|c| c.to_array());
        let terms: Vec<String> = g.terms.iter().map(|(n, v)| format!("\"{n}\":{v:?}")).collect();
        let _ = write!(s, "{}{{\"object_from_tcp\":{m:?},\"position\":{p:?},\"width\":{:?},\"contacts\":{c:?},\"score\":{:?},\"closing_turn\":{:?},\"terms\":{{{}}}}}",
            if i > 0 { "," } else { "" }, g.width, g.score, g.closing_turn, terms.join(","));
    }
    s.push_str("]}");
    s
}
