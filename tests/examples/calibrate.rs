//! Prints how well each method does on the three levels of simulated features.
//!
//! ```sh
//! cargo run --release -p semfm-tests --example calibrate [OBJECTS [LEVEL…]]
//! ```

use semfm::fmap::Method;
use semfm_synth::Level;
use semfm_tests::calibration::{Plan, Result, Scores};

#[allow(clippy::print_stdout, reason = "the table is what this program is for")]
fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let n_objects = arguments.next().map_or(Ok(4), |text| text.parse())?;
    let named =
        arguments.map(|text| text.parse()).collect::<std::result::Result<Vec<Level>, _>>()?;
    let levels = if named.is_empty() { Level::ALL.to_vec() } else { named };
    for level in levels {
        let plan = Plan { level, methods: &Method::ALL, seeds: 0..2, n_objects };
        println!("\n{level}, vertex IoU\n\n{}", Scores::measure(&plan)?);
    }
    Ok(())
}
