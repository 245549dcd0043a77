//! Monte Carlo studies: how good are plans over many runs?
pub mod normal;
