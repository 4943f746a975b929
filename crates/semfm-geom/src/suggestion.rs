//! The name that was meant, where a table does not have the one that was given.

/// What was given, in quotes, and the name of the table that is closest, if one is close.
///
/// ```
/// use semfm_geom::suggestion::unknown_name;
/// assert_eq!(unknown_name("fussed", ["fused", "nearest"]), "`fussed`; did you mean `fused`?");
/// assert_eq!(unknown_name("magic", ["fused", "nearest"]), "`magic`");
/// ```
pub fn unknown_name<'a>(given: &str, names: impl IntoIterator<Item = &'a str>) -> String {
    match closest_name(given, names) {
        Some(name) => format!("`{given}`; did you mean `{name}`?"),
        None => format!("`{given}`"),
    }
}

/// The name that differs from the one given in fewest letters, and in few enough to be a slip: a
/// third of them. Case, `-`, `_` and blanks do not count; one that the given one begins, or is begun
/// by, counts as close.
pub fn closest_name<'a>(given: &str, names: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let given = letters(given);
    let mut best: Option<(usize, &str)> = None;
    for name in names {
        let own = letters(name);
        let shorter = given.len().min(own.len());
        let is_start = shorter >= 3 && given[..shorter] == own[..shorter];
        let steps =
            if is_start { 1.min(given.len().abs_diff(own.len())) } else { edits(&given, &own) };
        let few = (given.len().max(own.len()) / 3).max(1);
        if steps <= few && best.is_none_or(|(least, _)| steps < least) {
            best = Some((steps, name));
        }
    }
    best.map(|(_, name)| name)
}

/// More letters are no name of ours.
const LONGEST: usize = 64;

fn letters(name: &str) -> Vec<char> {
    let kept = name.chars().filter(|c| !matches!(c, '-' | '_' | ' '));
    kept.flat_map(char::to_lowercase).take(LONGEST).collect()
}

/// Levenshtein's distance: letters put in, left out or changed.
fn edits(a: &[char], b: &[char]) -> usize {
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.iter().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let changed = diagonal + usize::from(x != y);
            diagonal = row[j + 1];
            row[j + 1] = changed.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slips_are_seen_and_other_words_are_not() {
        let names = ["franka", "robotiq-2f85", "robotiq-2f140"];
        for (given, meant) in [
            ("frnka", Some("franka")),
            ("Franka", Some("franka")),
            ("Robotiq_2F85", Some("robotiq-2f85")),
            ("robotiq2f14", Some("robotiq-2f140")),
            ("robotiq", Some("robotiq-2f85")),
            ("barrett", None),
            ("", None),
        ] {
            assert_eq!(closest_name(given, names), meant, "{given}");
        }
        assert_eq!(edits(&letters("kitten"), &letters("sitting")), 3);
    }
}
