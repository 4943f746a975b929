//! How many tests passed, failed and were skipped, read from what the runners print.
//!
//! Rust's test harness knows no skipped tests: one that lacks its data prints a line that begins
//! with `SKIPPED` and returns. Such a test is counted as skipped, not as passed.

use std::fmt;

/// Sums over all runners.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Tests that ran and held.
    pub passed: usize,
    /// Tests that did not hold, and runners that could not start.
    pub failed: usize,
    /// Tests that did not run.
    pub skipped: usize,
    /// Why, one line each.
    pub reasons: Vec<String>,
    /// What failed, by the names that the runners print.
    pub failures: Vec<String>,
}

impl Tally {
    /// Counts one thing that either worked or did not.
    pub fn count(&mut self, name: &str, worked: bool) {
        if worked {
            self.passed += 1;
        } else {
            self.failed += 1;
            self.failures.push(name.to_owned());
        }
    }

    /// Adds another sum to this one.
    pub fn add(&mut self, other: Self) {
        self.passed += other.passed;
        self.failed += other.failed;
        self.skipped += other.skipped;
        self.reasons.extend(other.reasons);
        self.failures.extend(other.failures);
    }

    /// A runner that failed without a failed test (it did not build, say) is one failure.
    pub fn closed(mut self, succeeded: bool) -> Self {
        if !succeeded && self.failed == 0 {
            self.failed = 1;
        }
        self
    }

    /// Turns tests that were skipped for want of the shared data into failures. Their reasons say
    /// `no shared …`; a library that "cannot open shared object file" is another reason.
    pub fn demand_shared_data(&mut self) {
        let wanting: usize = self
            .reasons
            .iter()
            .filter(|reason| reason.contains(": no shared "))
            .map(|reason| tests_behind(reason))
            .sum();
        let wanting = wanting.min(self.skipped);
        self.skipped -= wanting;
        self.failed += wanting;
    }
}

impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} passed, {} failed, {} skipped", self.passed, self.failed, self.skipped)
    }
}

/// Reads `cargo test -- --show-output`, line by line.
#[derive(Default)]
pub struct CargoTest {
    tally: Tally,
    /// Whether the test whose output is being read was already counted as skipped.
    counted: bool,
    /// Tests of this binary that returned early: the harness will count them as passed.
    returned_early: usize,
}

impl CargoTest {
    /// The next line of standard output.
    pub fn read(&mut self, line: &str) {
        if line.starts_with("---- ") {
            self.counted = false;
        } else if line.starts_with("SKIPPED") {
            self.tally.reasons.push(line.to_owned());
            if !self.counted {
                self.counted = true;
                self.returned_early += 1;
            }
        } else if let Some(name) = line.strip_suffix(" ... FAILED") {
            self.tally.failures.push(name.trim_start_matches("test ").to_owned());
        } else if let Some(result) = line.strip_prefix("test result: ") {
            let early = std::mem::take(&mut self.returned_early);
            self.counted = false;
            self.tally.skipped += early;
            // "ok. 3 passed; 0 failed; 1 ignored; 0 measured; …"
            let counts = result.split_once(". ").map_or("", |(_, counts)| counts);
            for (number, word) in counts.split("; ").filter_map(number_and_word) {
                match word {
                    "passed" => self.tally.passed += number.saturating_sub(early),
                    "failed" => self.tally.failed += number,
                    "ignored" => self.tally.skipped += number,
                    _ => {}
                }
            }
        }
    }

    /// The sum, once the runner has ended.
    pub fn end(self, succeeded: bool) -> Tally {
        self.tally.closed(succeeded)
    }
}

/// Reads pytest's output, line by line.
#[derive(Default)]
pub struct Pytest(Tally);

impl Pytest {
    /// The next line of standard output.
    pub fn read(&mut self, line: &str) {
        if line.starts_with("SKIPPED [") {
            self.0.reasons.push(line.to_owned());
            return;
        }
        let failed = line.strip_prefix("FAILED ").or_else(|| line.strip_prefix("ERROR "));
        // Captured lines of a log have more blanks.
        if let Some(name) = failed.filter(|name| !name.starts_with(' ')) {
            self.0.failures.push(name.to_owned());
            return;
        }
        // "==== 3 passed, 1 skipped in 0.12s ===="
        let Some((counts, _)) = line.trim_matches('=').trim().rsplit_once(" in ") else { return };
        for (number, word) in counts.split(", ").filter_map(number_and_word) {
            match word {
                "passed" | "xfailed" => self.0.passed += number,
                "failed" | "error" | "errors" | "xpassed" => self.0.failed += number,
                "skipped" => self.0.skipped += number,
                _ => {}
            }
        }
    }

    /// The sum, once the runner has ended.
    pub fn end(self, succeeded: bool) -> Tally {
        self.0.closed(succeeded)
    }
}

/// Pytest says in brackets how many tests a reason stands for.
fn tests_behind(reason: &str) -> usize {
    let number = reason.strip_prefix("SKIPPED [").and_then(|rest| rest.split_once(']'));
    number.and_then(|(number, _)| number.parse().ok()).unwrap_or(1)
}

fn number_and_word(text: &str) -> Option<(usize, &str)> {
    let (number, word) = text.trim().split_once(' ')?;
    Some((number.parse().ok()?, word))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cargo_test(text: &str, succeeded: bool) -> String {
        let mut reader = CargoTest::default();
        text.lines().for_each(|line| reader.read(line));
        reader.end(succeeded).to_string()
    }

    fn pytest(text: &str, succeeded: bool) -> String {
        let mut reader = Pytest::default();
        text.lines().for_each(|line| reader.read(line));
        reader.end(succeeded).to_string()
    }

    #[test]
    fn a_test_that_says_skipped_did_not_pass() {
        let text = "running 3 tests\ntest a ... ok\n\nsuccesses:\n\n\
            ---- a stdout ----\nSKIPPED: no shared data\nSKIPPED: nor this\n\n\
            ---- b stdout ----\nSKIPPED: no shared data\n\nsuccesses:\n    a\n    b\n\n\
            test result: ok. 3 passed; 0 failed; 1 ignored; 0 measured; 0 filtered out; finished in 0.1s\n\
            test result: FAILED. 1 passed; 2 failed; 0 ignored; 0 measured; 0 filtered out; finished in 0.1s";
        assert_eq!(cargo_test(text, false), "2 passed, 2 failed, 3 skipped");
    }

    #[test]
    fn a_runner_that_could_not_start_is_a_failure() {
        assert_eq!(cargo_test("error: could not compile", false), "0 passed, 1 failed, 0 skipped");
        assert_eq!(pytest("no tests ran in 0.01s", false), "0 passed, 1 failed, 0 skipped");
    }

    #[test]
    fn the_last_line_of_pytest_counts() {
        let text = "SKIPPED [1] tests/a.py:3: no shared data\n\
            ===== 1 failed, 31 passed, 2 skipped, 1 warning, 1 error in 3.21s =====";
        assert_eq!(pytest(text, false), "31 passed, 2 failed, 2 skipped");
        assert_eq!(pytest("5 passed in 0.10s", true), "5 passed, 0 failed, 0 skipped");
        assert_eq!(
            pytest("=== 4 passed in 61.02s (0:01:01) ===", true),
            "4 passed, 0 failed, 0 skipped"
        );
    }

    #[test]
    fn what_failed_is_named() {
        let mut reader = CargoTest::default();
        let doc_test = "test crates/a/src/lib.rs - a (line 3)";
        for line in ["test it ... ok", "test io::b ... FAILED", &format!("{doc_test} ... FAILED")] {
            reader.read(line);
        }
        assert_eq!(reader.end(false).failures, ["io::b", "crates/a/src/lib.rs - a (line 3)"]);
        let mut reader = Pytest::default();
        reader.read("FAILED tests/a.py::test_b - assert 1 == 2");
        assert_eq!(reader.end(false).failures, ["tests/a.py::test_b - assert 1 == 2"]);
    }

    #[test]
    fn missing_shared_data_can_be_made_a_failure() {
        let reasons = [
            "SKIPPED: no shared data",
            "SKIPPED: no CUDA",
            "SKIPPED [2] a.py: no shared data",
            "SKIPPED [3] b.py: libusb-1.0.so.0: cannot open shared object file",
        ];
        let reasons = reasons.map(String::from).to_vec();
        let mut tally = Tally { passed: 1, skipped: 7, reasons, ..Tally::default() };
        tally.demand_shared_data();
        assert_eq!(tally.to_string(), "1 passed, 3 failed, 4 skipped");
    }
}
