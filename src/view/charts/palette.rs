//! The colours of series, and of plans beside each other.

use plotters::style::RGBColor;

/// Colours that the colour-blind can tell apart (Okabe and Ito).
pub const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(230, 159, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(213, 94, 0),
    RGBColor(148, 103, 189),
];

/// The vermilion of what others are compared with: random plans.
const REFERENCE: RGBColor = COLOURS[5];

/// The colours of plans beside each other, in their order and by whether others are compared with each: the same on pages and in
/// recordings.
pub fn plan_colours(is_reference: impl IntoIterator<Item = bool>) -> Vec<RGBColor> {
    let others = COLOURS.into_iter().filter(|colour| *colour != REFERENCE);
    let mut others = others.cycle();
    let colour = |is_reference: bool| {
        let other = (!is_reference).then(|| others.next());
        other.flatten().unwrap_or(REFERENCE)
    };
    is_reference.into_iter().map(colour).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plans_have_colours_of_their_own_and_the_reference_its_own() {
        let colours = plan_colours([true, false, false]);
        assert_eq!(colours, [REFERENCE, COLOURS[0], COLOURS[1]]);
        assert_eq!(plan_colours([false, true])[0], colours[1]);
    }
}
