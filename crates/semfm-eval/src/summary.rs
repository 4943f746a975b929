//! Means, spreads and intervals, by group, by category and over all; and methods against methods.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use crate::bootstrap::{BootstrapSettings, PairDraws, PairKey, weighted_mean};
use crate::row::Row;
use crate::variant::Variant;

/// Below this IoU an answer is useless.
pub const POOR: f64 = 0.3;
/// Smaller differences of IoU count as none.
pub(crate) const NOTICED: f64 = 0.01;

/// Which pairs are summed up.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "scope", content = "name", rename_all = "snake_case")]
#[non_exhaustive]
pub enum Scope {
    /// One group of pairs.
    Group(String),
    /// All pairs of one category.
    Category(String),
    /// All pairs.
    All,
    /// The mean of the categories' means: each counts the same, however many pairs it has.
    MeanOfCategories,
}

impl Scope {
    fn holds(&self, pair: &CategorisedPair<'_>) -> bool {
        match self {
            Self::Group(name) => pair.key.group == name,
            Self::Category(name) => pair.category == name,
            Self::All | Self::MeanOfCategories => true,
        }
    }
}

/// One method on the pairs of one scope.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Which pairs.
    #[serde(flatten)]
    pub scope: Scope,
    /// Name of the method.
    pub method: String,
    /// Pairs with a score.
    pub n: usize,
    /// Pairs that could not be tried, or had no answer.
    pub n_failed: usize,
    /// Mean vertex IoU.
    pub mean: Option<f64>,
    /// Standard deviation over the pairs (n − 1).
    pub std: Option<f64>,
    /// 95 % interval of the mean, objects resampled.
    pub interval: Option<[f64; 2]>,
    /// Share of pairs below .3.
    pub below_poor: Option<f64>,
    /// Mean IoU by area.
    pub area_mean: Option<f64>,
    /// Mean of the lower bound (`whole`) on the same pairs.
    pub lower_bound: Option<f64>,
    /// Mean of the upper bound (`oracle`) on the same pairs.
    pub upper_bound: Option<f64>,
    /// Where the mean m is between the bounds: (m − lower) / (upper − lower).
    pub between_bounds: Option<f64>,
    /// Mean share of a source anchor that lands in its partner.
    pub anchor_landed: Option<f64>,
    /// Mean distance of carried anchors from their partners, in √area.
    pub anchor_distance: Option<f64>,
    /// Median milliseconds from prepared objects to the region.
    pub median_matching_ms: Option<f64>,
    /// Median milliseconds from embeddings to the region, nothing cached.
    pub median_cold_ms: Option<f64>,
    /// Median seconds from meshes to the region, where the encoder was timed.
    pub median_paper_runtime: Option<f64>,
}

/// How much better one method is than another, pair by pair.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Difference {
    /// Which pairs.
    #[serde(flatten)]
    pub scope: Scope,
    /// The method.
    pub method: String,
    /// The one it is compared with.
    pub against: String,
    /// Pairs that both have a score for.
    pub n: usize,
    /// Mean of IoU(method) − IoU(against).
    pub mean: f64,
    /// 95 % interval, objects resampled.
    pub interval: Option<[f64; 2]>,
    /// Pairs where the method is better by more than .01, and where it is worse.
    pub better_worse: [usize; 2],
}

impl Difference {
    /// +1 or −1 where the interval excludes zero.
    pub fn sign(&self) -> i8 {
        match self.interval {
            Some([low, _]) if low > 0.0 => 1,
            Some([_, high]) if high < 0.0 => -1,
            _ => 0,
        }
    }
}

/// Scores as a table: a line for each pair, a column for each method.
pub struct ScoreTable<'a> {
    /// Methods in the order in which rows name them first.
    pub methods: Vec<&'a str>,
    pairs: Vec<CategorisedPair<'a>>,
    /// Rows of each pair, by method.
    rows: Vec<Vec<Option<&'a Row>>>,
}

/// A pair and the category of its objects.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct CategorisedPair<'a> {
    category: &'a str,
    key: PairKey<'a>,
}

impl<'a> ScoreTable<'a> {
    /// Sorts rows into a table, pairs in the order of their first row.
    pub fn new(rows: &'a [Row]) -> Self {
        let mut table = Self { methods: Vec::new(), pairs: Vec::new(), rows: Vec::new() };
        let mut place_of = std::collections::BTreeMap::new();
        for row in rows {
            let method = table.methods.iter().position(|&m| m == row.method).unwrap_or_else(|| {
                table.methods.push(&row.method);
                table.methods.len() - 1
            });
            let named = CategorisedPair { category: &row.category, key: row.pair_key() };
            let pair = *place_of.entry(named).or_insert_with(|| {
                table.pairs.push(named);
                table.rows.push(Vec::new());
                table.pairs.len() - 1
            });
            let line = &mut table.rows[pair];
            if line.len() <= method {
                line.resize(method + 1, None);
            }
            line[method] = Some(row);
        }
        table
    }

    /// Groups in the order of the rows.
    pub fn groups(&self) -> Vec<&'a str> {
        in_order(self.pairs.iter().map(|pair| pair.key.group))
    }

    /// Categories in the order of the rows.
    pub fn categories(&self) -> Vec<&'a str> {
        in_order(self.pairs.iter().map(|pair| pair.category))
    }

    fn scopes(&self) -> Vec<Scope> {
        let groups = self.groups().into_iter().map(|name| Scope::Group(name.into()));
        let categories = self.categories().into_iter().map(|name| Scope::Category(name.into()));
        groups.chain(categories).chain([Scope::All, Scope::MeanOfCategories]).collect()
    }

    fn places(&self, scope: &Scope) -> Vec<usize> {
        (0..self.pairs.len()).filter(|&i| scope.holds(&self.pairs[i])).collect()
    }

    fn row(&self, pair: usize, method: usize) -> Option<&'a Row> {
        self.rows[pair].get(method).copied().flatten()
    }

    fn values(
        &self,
        places: &[usize],
        method: usize,
        of: fn(&Row) -> Option<f64>,
    ) -> Vec<Option<f64>> {
        places.iter().map(|&pair| self.row(pair, method).and_then(of)).collect()
    }

    /// Every scope and method.
    pub fn summaries(&self, settings: &BootstrapSettings) -> Vec<Summary> {
        let mut all = Vec::new();
        for scope in self.scopes() {
            let view = View::new(self, scope, settings);
            all.extend((0..self.methods.len()).map(|method| view.summary(method)));
        }
        all
    }

    /// Every scope and every two methods, the later listed against the earlier.
    pub fn differences(&self, settings: &BootstrapSettings) -> Vec<Difference> {
        let mut all = Vec::new();
        let compared: Vec<usize> =
            (0..self.methods.len()).filter(|&m| !is_bound(self.methods[m])).collect();
        for scope in self.scopes() {
            let view = View::new(self, scope, settings);
            for (place, &against) in compared.iter().enumerate() {
                let others = compared[place + 1..].iter();
                all.extend(others.filter_map(|&method| view.difference(method, against)));
            }
        }
        all
    }
}

/// Whether a method is one of the bounds, which compete with no method.
pub(crate) fn is_bound(method: &str) -> bool {
    [Variant::LOWER_BOUND.name(), Variant::UPPER_BOUND.name()].contains(&method)
}

fn in_order<'a>(names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut seen = BTreeSet::new();
    names.filter(|name| seen.insert(*name)).collect()
}

/// The pairs of one scope, with their resamplings.
struct View<'t, 'a> {
    table: &'t ScoreTable<'a>,
    scope: Scope,
    places: Vec<usize>,
    draws: PairDraws,
}

impl<'t, 'a> View<'t, 'a> {
    fn new(table: &'t ScoreTable<'a>, scope: Scope, settings: &BootstrapSettings) -> Self {
        let places = table.places(&scope);
        let pairs: Vec<PairKey<'_>> = places.iter().map(|&i| table.pairs[i].key).collect();
        let draws = PairDraws::new(&pairs, settings);
        Self { table, scope, places, draws }
    }

    /// The mean of the scope: over its pairs, or over the means of its categories.
    fn mean(&self, values: &[Option<f64>], weights: &[f64]) -> Option<f64> {
        if self.scope != Scope::MeanOfCategories {
            return weighted_mean(values, weights);
        }
        let means: Vec<Option<f64>> = self
            .table
            .categories()
            .into_iter()
            .map(|category| {
                let inside: Vec<usize> = (0..values.len())
                    .filter(|&i| self.table.pairs[self.places[i]].category == category)
                    .collect();
                let values: Vec<_> = inside.iter().map(|&i| values[i]).collect();
                let weights: Vec<_> = inside.iter().map(|&i| weights[i]).collect();
                weighted_mean(&values, &weights)
            })
            .collect();
        weighted_mean(&means, &vec![1.0; means.len()])
    }

    fn plain_mean(&self, values: &[Option<f64>]) -> Option<f64> {
        self.mean(values, &vec![1.0; values.len()])
    }

    /// Mean of a bound on those pairs that have a score in `values`.
    fn bound(&self, bound: Variant, values: &[Option<f64>]) -> Option<f64> {
        let method = self.table.methods.iter().position(|&name| name == bound.name())?;
        let bounds = self.table.values(&self.places, method, |row| row.iou);
        let both: Vec<Option<f64>> =
            bounds.into_iter().zip(values).map(|(b, v)| v.and(b)).collect();
        self.plain_mean(&both)
    }

    fn values(&self, method: usize, of: fn(&Row) -> Option<f64>) -> Vec<Option<f64>> {
        self.table.values(&self.places, method, of)
    }

    /// The method's rows.
    fn rows(&self, method: usize) -> impl Iterator<Item = &'a Row> {
        self.places.iter().filter_map(move |&pair| self.table.row(pair, method))
    }

    fn summary(&self, method: usize) -> Summary {
        let ious = self.values(method, |row| row.iou);
        let scored: Vec<f64> = ious.iter().flatten().copied().collect();
        let mean = self.plain_mean(&ious);
        let lower_bound = self.bound(Variant::LOWER_BOUND, &ious);
        let upper_bound = self.bound(Variant::UPPER_BOUND, &ious);
        let anchors = self.rows(method).flat_map(|row| &row.anchors);
        let distances: Vec<f64> = anchors.filter_map(|anchor| anchor.mean_distance).collect();
        Summary {
            scope: self.scope.clone(),
            method: self.table.methods[method].into(),
            n: scored.len(),
            n_failed: self.rows(method).filter(|row| row.failure.is_some()).count(),
            mean,
            std: deviation(&scored),
            interval: self.draws.interval(|weights| self.mean(&ious, weights)),
            below_poor: self.plain_mean(&self.values(method, is_poor)),
            area_mean: self.plain_mean(&self.values(method, |row| row.area_iou)),
            lower_bound,
            upper_bound,
            between_bounds: between(mean, lower_bound, upper_bound),
            anchor_landed: self.plain_mean(&self.values(method, mean_landed)),
            anchor_distance: mean_of(&distances),
            median_matching_ms: median(self.values(method, |row| row.matching_ms)),
            median_cold_ms: median(self.values(method, |row| row.cold_ms)),
            median_paper_runtime: median(self.values(method, |row| row.paper_runtime)),
        }
    }

    fn difference(&self, method: usize, against: usize) -> Option<Difference> {
        let ours = self.values(method, |row| row.iou);
        let theirs = self.values(against, |row| row.iou);
        let gaps: Vec<Option<f64>> =
            ours.iter().zip(&theirs).map(|(a, b)| Some((*a)? - (*b)?)).collect();
        let known = gaps.iter().flatten();
        Some(Difference {
            scope: self.scope.clone(),
            method: self.table.methods[method].into(),
            against: self.table.methods[against].into(),
            n: known.clone().count(),
            mean: self.plain_mean(&gaps)?,
            interval: self.draws.interval(|weights| self.mean(&gaps, weights)),
            better_worse: [
                known.clone().filter(|&&gap| gap > NOTICED).count(),
                known.filter(|&&gap| gap < -NOTICED).count(),
            ],
        })
    }
}

/// 1 where the answer is useless, else 0.
fn is_poor(row: &Row) -> Option<f64> {
    row.iou.map(|iou| f64::from(u8::from(iou < POOR)))
}

/// Mean share of the row's anchors that lands in their partners.
fn mean_landed(row: &Row) -> Option<f64> {
    let n = row.anchors.len() as f64;
    (n > 0.0).then(|| row.anchors.iter().map(|anchor| anchor.landed).sum::<f64>() / n)
}

/// (m − lower) / (upper − lower); none where the bounds are the same.
fn between(mean: Option<f64>, lower: Option<f64>, upper: Option<f64>) -> Option<f64> {
    Some((mean? - lower?) / (upper? - lower?)).filter(|share| share.is_finite())
}

/// None for nothing.
fn mean_of(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// √(Σ (xᵢ − mean)² / (n − 1)); none below two values.
fn deviation(values: &[f64]) -> Option<f64> {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let square: f64 = values.iter().map(|x| (x - mean).powi(2)).sum();
    (values.len() > 1).then(|| (square / (n - 1.0)).sqrt())
}

/// The middle value, or the mean of the two in the middle.
fn median(values: Vec<Option<f64>>) -> Option<f64> {
    let mut values: Vec<f64> = values.into_iter().flatten().collect();
    values.sort_by(f64::total_cmp);
    let n = values.len();
    match n {
        0 => None,
        _ => Some((values[(n - 1) / 2] + values[n / 2]) / 2.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(category: &str, pair: (&str, &str), method: &str, iou: Option<f64>) -> Row {
        Row {
            group: format!("{category} things"),
            category: category.to_owned(),
            source: pair.0.to_owned(),
            target: pair.1.to_owned(),
            method: method.to_owned(),
            iou,
            failure: iou.is_none().then(|| crate::row::Failure::new("object", "gone")),
            ..Row::default()
        }
    }

    /// Two categories, four objects and two: fused is better than nearest in the first.
    fn rows() -> Vec<Row> {
        let mut rows = Vec::new();
        for (i, pair) in [("a", "b"), ("a", "c"), ("b", "a"), ("b", "c"), ("c", "a"), ("d", "b")]
            .iter()
            .enumerate()
        {
            let base = 0.5 + 0.02 * i as f64;
            rows.push(row("cups", *pair, "fused", Some(base + 0.2)));
            rows.push(row("cups", *pair, "nearest", Some(base)));
            rows.push(row("cups", *pair, "oracle", Some(1.0)));
            rows.push(row("cups", *pair, "whole", Some(0.1)));
        }
        rows.push(row("shoes", ("x", "y"), "fused", Some(0.2)));
        rows.push(row("shoes", ("x", "y"), "nearest", None));
        rows
    }

    #[test]
    fn means_bounds_and_failures_are_counted_on_the_same_pairs() {
        let rows = rows();
        let table = ScoreTable::new(&rows);
        let summaries = table.summaries(&BootstrapSettings { draws: 200, ..Default::default() });
        let find = |scope: Scope, method: &str| {
            summaries.iter().find(|s| s.scope == scope && s.method == method).unwrap().clone()
        };
        let cups = find(Scope::Group("cups things".into()), "fused");
        assert_eq!((cups.n, cups.upper_bound), (6, Some(1.0)));
        assert!((cups.lower_bound.unwrap() - 0.1).abs() < 1e-12);
        assert!((cups.mean.unwrap() - 0.75).abs() < 1e-12);
        assert!((cups.between_bounds.unwrap() - 0.65 / 0.9).abs() < 1e-12);
        let all = find(Scope::All, "nearest");
        assert_eq!((all.n, all.n_failed), (6, 1));
        let both = find(Scope::MeanOfCategories, "fused");
        assert!((both.mean.unwrap() - (0.75 + 0.2) / 2.0).abs() < 1e-12);
        let shoes = find(Scope::Category("shoes".into()), "fused");
        assert_eq!((shoes.below_poor, shoes.std, shoes.lower_bound), (Some(1.0), None, None));
    }

    #[test]
    fn a_constant_gain_is_significant_and_bounds_are_not_compared() {
        let rows = rows();
        let table = ScoreTable::new(&rows);
        let differences =
            table.differences(&BootstrapSettings { draws: 200, ..Default::default() });
        assert!(differences.iter().all(|d| d.method != "whole" && d.against != "oracle"));
        let gain = differences
            .iter()
            .find(|d| d.scope == Scope::Group("cups things".into()) && d.method == "nearest")
            .unwrap();
        assert!((gain.mean + 0.2).abs() < 1e-12, "nearest against fused: {}", gain.mean);
        assert_eq!((gain.sign(), gain.better_worse, gain.n), (-1, [0, 6], 6));
    }
}
