//! Random numbers that are a function of the seed and the run alone, so that any run can be
//! replayed by itself, in any order, on any number of threads.
//!
//! - [`generator`]: any random numbers, such as those of searches and random plans.
//! - [`normal`]: the noise of measurements, many runs at a time.
//! - [`streams`]: which numbers are for what.

pub mod normal;
pub mod streams;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// The generator of a stream under `seed`: one of 2^64 independent streams of the seed's cipher.
pub fn generator(seed: u64, stream: u64) -> ChaCha8Rng {
    let mut generator = ChaCha8Rng::seed_from_u64(seed);
    generator.set_stream(stream);
    generator
}
