//! Where the instrument may stand.

use nalgebra::Vector3;

/// A place where the instrument may stand when it reads positions or poses, or the point from which it reads distances.
///
/// It tells how far and how well the instrument sees from there; where its frame is in space is unknown all the same, and is found
/// from its readings.
#[derive(Debug, Clone, PartialEq)]
pub struct Station {
    /// Its name, as candidates, plans and measurements have it.
    pub name: String,
    /// Whether distances are read from there, and not positions or poses.
    pub reads_distances: bool,
    /// The instrument's point of reference (m), in the world frame.
    pub position_m: Vector3<f64>,
    /// The smallest and the largest distance (m) at which it reads a target, where they are bounded.
    pub range_m: [Option<f64>; 2],
    /// The largest angle (rad) between a target's z axis and the line from it to the instrument, where it is bounded: how far a
    /// reflector may turn away.
    pub incidence_max_rad: Option<f64>,
}

/// The station of a name among those that a task has.
pub fn station_named<'a>(stations: &'a [Station], name: Option<&str>) -> Option<&'a Station> {
    let name = name?;
    stations.iter().find(|station| station.name == name)
}
