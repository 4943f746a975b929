//! The paper's own numbers, quoted: other meshes and another encoder, so they stand beside ours and
//! are no contest.
//!
//! Dong & Zhi, "Affordance Transfer Across Object Instances via Semantically Anchored Functional
//! Map", table I: mean IoU (top) and mean seconds a transfer (bottom) in six categories.

/// The six categories in the paper's order, in the generator's names.
pub const CATEGORIES: [&str; 6] =
    ["tools", "shoes", "cutting", "containers", "controllers", "scissors"];

/// A row of the paper's table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PublishedRow {
    /// The method's name in the paper.
    pub method: &'static str,
    /// Views that a vision-language model was shown.
    pub n_views: Option<usize>,
    /// One number per category.
    pub values: [f64; 6],
}

impl PublishedRow {
    /// Mean over the categories.
    pub fn mean(&self) -> f64 {
        self.values.iter().sum::<f64>() / self.values.len() as f64
    }
}

/// Mean IoU.
pub const IOU: [PublishedRow; 4] = [
    PublishedRow { method: "FM-WKS", n_views: None, values: [0.03, 0.10, 0.05, 0.07, 0.15, 0.11] },
    PublishedRow {
        method: "VLM (1 POV)",
        n_views: Some(1),
        values: [0.48, 0.40, 0.45, 0.45, 0.42, 0.47],
    },
    PublishedRow {
        method: "VLM (6 POV)",
        n_views: Some(6),
        values: [0.68, 0.65, 0.69, 0.56, 0.68, 0.56],
    },
    PublishedRow { method: "SemFM", n_views: None, values: [0.70, 0.60, 0.69, 0.53, 0.65, 0.62] },
];

/// Mean seconds a transfer, views and embedding included, reconstruction not.
pub const SECONDS: [PublishedRow; 4] = [
    PublishedRow {
        method: "VLM (1 POV)",
        n_views: Some(1),
        values: [31.7, 38.4, 31.2, 35.7, 38.6, 42.4],
    },
    PublishedRow {
        method: "VLM (3 POV)",
        n_views: Some(3),
        values: [37.4, 42.6, 35.6, 41.8, 46.2, 45.6],
    },
    PublishedRow {
        method: "VLM (6 POV)",
        n_views: Some(6),
        values: [45.2, 48.7, 44.6, 46.1, 53.6, 47.6],
    },
    PublishedRow { method: "SemFM", n_views: None, values: [9.72, 9.93, 9.21, 11.45, 8.86, 8.69] },
];

/// The paper's category that a folder or generator category is: `4_water_containers` is number 3.
pub fn paper_category(name: &str) -> Option<usize> {
    let lower = name.to_lowercase();
    let leading =
        lower.split(|c: char| !c.is_ascii_digit()).next().and_then(|d| d.parse::<usize>().ok());
    let by_number = leading.filter(|n| (1..=6).contains(n)).map(|n| n - 1);
    // "cutting tools" and "scissor tools" are no "tools": the general word is tried last.
    let words = [
        (5, "scissor"),
        (2, "cutting"),
        (1, "shoe"),
        (3, "container"),
        (4, "controller"),
        (0, "tools"),
    ];
    let by_word = words.iter().find(|(_, word)| lower.contains(word)).map(|(place, _)| *place);
    by_number.or(by_word)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_means_are_those_that_the_paper_states() {
        fn mean(rows: &[PublishedRow], name: &str) -> f64 {
            rows.iter().find(|row| row.method == name).unwrap().mean()
        }
        assert!((mean(&IOU, "SemFM") - 0.632).abs() < 5e-4);
        assert!((mean(&IOU, "FM-WKS") - 0.085).abs() < 5e-4);
        assert!((mean(&IOU, "VLM (6 POV)") - 0.637).abs() < 5e-4);
        assert!((mean(&SECONDS, "SemFM") - 9.64).abs() < 5e-3);
        assert!((mean(&SECONDS, "VLM (6 POV)") - 47.6).abs() < 0.05);
    }

    #[test]
    fn folders_and_generators_name_the_papers_categories() {
        for (place, name) in CATEGORIES.into_iter().enumerate() {
            assert_eq!(paper_category(name), Some(place), "{name}");
        }
        assert_eq!(paper_category("4_water_containers"), Some(3));
        assert_eq!(paper_category("6_scissor_tools"), Some(5));
        assert_eq!(paper_category("cutting tools"), Some(2));
        assert_eq!(paper_category("birds"), None);
    }
}
