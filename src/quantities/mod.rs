//! Numbers from elsewhere and to elsewhere: how large they may be, and their units.
//!
//! - [`limits`]: how large things may be that are counted.
//! - [`plausible`]: for each kind of quantity the range that every reader takes.
//! - [`units`]: from SI units to those of files; [`written`]: serialisers of such fields.

pub mod limits;
pub mod plausible;
pub mod units;
pub mod written;
