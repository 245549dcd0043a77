//! From SI units to those of files, so that reading gives back the same number to the bit, and to those of people.

/// A quantity as a person reads it: the factor and the unit.
pub fn shown_unit(unit: &str) -> (f64, &str) {
    match unit {
        "m" => (1e3, "mm"),
        "rad" => (1e3, "mrad"),
        "rad/(N m)" => (1e6, "1e-6 rad/(N m)"),
        "m/N" => (1e6, "1e-6 m/N"),
        "m/m" => (1e6, "um/m"),
        unit => (1.0, unit),
    }
}

/// Degrees for an angle (rad) that is read with [`f64::to_radians`].
pub fn degrees(angle_rad: f64) -> f64 {
    shortest(angle_rad.to_degrees(), |written| {
        written.to_radians().to_bits() == angle_rad.to_bits()
    })
}

/// Thousandths of a unit (mm for m, mrad for rad) for a value that is read as these times 1e-3.
pub fn thousandths(value: f64) -> f64 {
    shortest(value * 1e3, |written| {
        (written * 1e-3).to_bits() == value.to_bits()
    })
}

/// Of the numbers next to `near` that are read back right, the one with the shortest decimal form.
/// Where there is none, since the written numbers are not as dense as those that are read, `near`.
fn shortest(near: f64, is_right: impl Fn(f64) -> bool) -> f64 {
    let (up, down) = (near.next_up(), near.next_down());
    [near, up, down, up.next_up(), down.next_down()]
        .into_iter()
        .filter(|&written| is_right(written))
        .min_by_key(|written| written.to_string().len())
        .unwrap_or(near)
}
