//! Weights as colours: grey to red, in painted meshes and in all pictures.

/// Colour without weight, as sRGB in 0..1.
pub const PLAIN: [f32; 3] = [0.78, 0.78, 0.78];
/// Colour of full weight.
pub const MARKED: [f32; 3] = [0.86, 0.16, 0.16];

/// The colour of each weight: grey to red. One half is where [`region_of_paint`] draws its line.
///
/// [`region_of_paint`]: crate::demonstration::region_of_paint
pub fn weight_colors(weights: &[f64]) -> Vec<[f32; 3]> {
    weights.iter().map(|&w| mixed(w.clamp(0.0, 1.0) as f32)).collect()
}

/// PLAIN + w (MARKED − PLAIN).
fn mixed(w: f32) -> [f32; 3] {
    std::array::from_fn(|c| PLAIN[c] + w * (MARKED[c] - PLAIN[c]))
}

/// sRGB in 0..1 as bytes.
pub fn color_bytes(color: [f32; 3]) -> [u8; 3] {
    color.map(|c| (c.clamp(0.0, 1.0) * 255.0).round() as u8)
}
