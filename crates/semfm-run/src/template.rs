//! A recipe to start from.

/// A commented `demo.toml`: every key, the usual ones in use.
pub const TEMPLATE: &str = include_str!("template.toml");

#[cfg(test)]
mod tests {
    use std::path::Path;

    use serde_json::Value;

    use super::*;
    use crate::Recipe;

    fn parsed(text: &str) -> Recipe {
        Recipe::parse(Path::new("demo.toml"), text).unwrap()
    }

    /// The template with every key in use.
    fn full() -> String {
        let is_setting = |rest: &str| {
            let rest = rest.trim_start();
            rest.starts_with('[')
                || rest.split_once(" = ").is_some_and(|(key, _)| !key.contains([' ', '`', ',']))
        };
        let lines = TEMPLATE.lines().map(|line| match line.strip_prefix("# ") {
            Some(rest) if is_setting(rest) => rest,
            _ => line,
        });
        lines.collect::<Vec<_>>().join("\n")
    }

    #[test]
    fn the_template_is_a_recipe_with_the_defaults_that_it_names() {
        let recipe = parsed(TEMPLATE);
        assert!(recipe.robot.is_none() && recipe.demonstration.frames.len() == 1);
        assert_eq!(crate::Stage::of(&recipe).len(), 5);
        let full = parsed(&full());
        let defaults = semfm::grasp::GraspSettings::default();
        let grasp = full.grasp.unwrap();
        assert_eq!(grasp.top, Some(defaults.top));
        assert_eq!(grasp.samples, Some(defaults.n_samples));
        assert_eq!(grasp.diversity, Some(defaults.diversity));
        assert_eq!(grasp.friction, Some(defaults.friction));
        assert_eq!(grasp.grip_force, Some(defaults.grip_force));
        assert_eq!(grasp.pad_in_region, Some(defaults.limits.pad_in_region));
        let defaults = semfm::motion::MotionSettings::default();
        let robot = full.robot.unwrap();
        assert_eq!(robot.speed, Some(defaults.speed));
        assert_eq!(robot.line_speed, Some(defaults.line_speed));
        assert_eq!(robot.approach_length, Some(defaults.approach));
        assert_eq!(robot.lift_height, Some(defaults.lift.z));
        let starts = semfm::align::AlignSettings::default().n_starts;
        assert_eq!(full.demonstration.align.starts, Some(starts));
        assert_eq!(full.target.align.starts, Some(starts));
        let shape = semfm::PipelineSettings::default().shape;
        assert_eq!(full.transfer.working_vertices, Some(shape.working_vertices));
        assert_eq!(full.transfer.k, Some(shape.k));
    }

    #[test]
    fn the_template_names_every_key() {
        let value = serde_json::to_value(parsed(&full())).unwrap();
        let mut missing = Vec::new();
        fn find(key: &str, value: &Value, missing: &mut Vec<String>) {
            match value {
                Value::Null => missing.push(key.to_owned()),
                Value::Array(items) => items.iter().for_each(|item| find(key, item, missing)),
                Value::Object(map) => {
                    map.iter()
                        .for_each(|(name, value)| find(&format!("{key}.{name}"), value, missing));
                }
                _ => {}
            }
        }
        find("", &value, &mut missing);
        assert!(missing.is_empty(), "no value in the template for {missing:?}");
    }
}
