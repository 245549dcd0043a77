//! What results may depend on to the last bit beyond the program, the scenario and the seed.

/// The machine's kind and system, and the instruction sets for which the numerical libraries have
/// code of its own, such as "`x86_64` linux avx2 fma".
pub fn platform() -> String {
    let mut platform = format!("{} {}", std::env::consts::ARCH, std::env::consts::OS);
    for name in instruction_sets() {
        platform += " ";
        platform += name;
    }
    platform
}

#[cfg(target_arch = "x86_64")]
fn instruction_sets() -> impl Iterator<Item = &'static str> {
    let found = [
        ("avx2", is_x86_feature_detected!("avx2")),
        ("fma", is_x86_feature_detected!("fma")),
        ("avx512f", is_x86_feature_detected!("avx512f")),
    ];
    (found.into_iter()).filter_map(|(name, has)| has.then_some(name))
}

#[cfg(not(target_arch = "x86_64"))]
fn instruction_sets() -> impl Iterator<Item = &'static str> {
    std::iter::empty()
}
