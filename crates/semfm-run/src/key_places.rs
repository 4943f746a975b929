//! On which line of a TOML file each key stands.

/// The keys of a file, in its order.
#[derive(Clone, Debug, Default)]
pub struct KeyPlaces {
    keys: Vec<KeyPlace>,
}

/// A key with its tables before it, `demonstration.frames[0].depth`, and its line from 1.
#[derive(Clone, Debug)]
struct KeyPlace {
    key: String,
    line: usize,
}

impl KeyPlaces {
    /// Of a text. It need not be sound: what is told of a broken file uses it, too.
    pub fn of(text: &str) -> Self {
        let mut keys: Vec<KeyPlace> = Vec::new();
        let mut table = String::new();
        let mut n_of_array: Vec<(String, usize)> = Vec::new();
        for (i, line) in text.lines().enumerate() {
            let (line, at) = (line.trim(), i + 1);
            if let Some(name) = between(line, "[[", "]]") {
                let place = n_of_array.iter().position(|(array, _)| *array == name);
                let n = match place {
                    Some(place) => {
                        n_of_array[place].1 += 1;
                        n_of_array[place].1
                    }
                    None => {
                        n_of_array.push((name.clone(), 0));
                        0
                    }
                };
                table = format!("{name}[{n}]");
                keys.push(KeyPlace { key: table.clone(), line: at });
            } else if let Some(name) = between(line, "[", "]") {
                table = name;
                keys.push(KeyPlace { key: table.clone(), line: at });
            } else if let Some((key, _)) = line.split_once('=')
                && is_key(key.trim())
            {
                let key = key.trim();
                let key = if table.is_empty() { key.into() } else { format!("{table}.{key}") };
                keys.push(KeyPlace { key, line: at });
            }
        }
        Self { keys }
    }

    /// `line 7, demonstration.mesh`; the table's line, or the key alone, where the key itself is not there.
    pub fn place_of(&self, key: &str) -> String {
        let line_of = |key: &str| self.keys.iter().find(|place| place.key == key);
        let mut table = key;
        loop {
            if let Some(place) = line_of(table) {
                return format!("line {}, {key}", place.line);
            }
            match table.rsplit_once('.') {
                Some((outer, _)) => table = outer,
                None => return key.to_owned(),
            }
        }
    }

    /// The last key that begins on a line or before it, without a table's.
    pub fn key_at(&self, line: usize) -> Option<&str> {
        let before = self.keys.iter().take_while(|place| place.line <= line);
        before.last().map(|place| place.key.as_str())
    }
}

/// What stands between two marks, spaces removed; `None` where the line is something else.
fn between(line: &str, open: &str, close: &str) -> Option<String> {
    let rest = line.strip_prefix(open)?;
    let name = &rest[..rest.find(close)?];
    (!name.is_empty()).then(|| name.split('.').map(str::trim).collect::<Vec<_>>().join("."))
}

fn is_key(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|b| b.is_ascii_alphanumeric() || b"_-.\"'".contains(&b))
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "title = \"x\"\n[demonstration]\nmesh = \"mug.obj\" # a = b\n\n\
                        [[demonstration.frames]]\ndepth = \"a\"\n[[demonstration.frames]]\ndepth = \"b\"\n\
                        [grasp]\n# gripper = \"x\"\n";

    #[test]
    fn keys_are_found_on_their_lines() {
        let places = KeyPlaces::of(TEXT);
        assert_eq!(places.place_of("title"), "line 1, title");
        assert_eq!(places.place_of("demonstration.mesh"), "line 3, demonstration.mesh");
        let second = "demonstration.frames[1].depth";
        assert_eq!(places.place_of(second), format!("line 8, {second}"));
        assert_eq!(places.place_of("grasp.gripper"), "line 9, grasp.gripper", "of its table");
        assert_eq!(places.place_of("robot.urdf"), "robot.urdf");
        assert_eq!(places.key_at(6), Some("demonstration.frames[0].depth"));
        assert_eq!(KeyPlaces::of("= [\n[[").key_at(2), None);
    }
}
