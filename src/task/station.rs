//! Where the instrument may stand.

use nalgebra::Vector3;

use crate::observation::LengthKind;
use crate::text::nearest;

/// A place where the instrument may stand when it reads positions or poses, or where it reads lengths from.
///
/// It tells how far and how well the instrument sees from there; where its frame is in space is unknown all the same, and is found
/// from its readings.
#[derive(Debug, Clone, PartialEq)]
pub struct Station {
    /// Its name, as candidates, plans and measurements have it.
    pub name: String,
    /// The lengths that are read from there; none where positions or poses are.
    pub reads: Option<LengthKind>,
    /// The instrument's point of reference (m), in the world frame.
    pub position_m: Vector3<f64>,
    /// The smallest and the largest distance (m) at which it reads a target, or length that it reads, where they are bounded.
    pub range_m: [Option<f64>; 2],
    /// The largest angle (rad) between a target's z axis and the line from it to the instrument, where it is bounded: how far a
    /// reflector may turn away.
    pub incidence_max_rad: Option<f64>,
}

impl Station {
    /// The end of its range that a length (m) misses by more than some room (m).
    pub fn missed(&self, length_m: f64, room_m: f64) -> Option<f64> {
        let [least, most] = self.range_m;
        (least.filter(|least| length_m < least - room_m))
            .or_else(|| most.filter(|most| length_m > most + room_m))
    }

    /// From where (m) it reads a target at a place (m).
    pub fn sees_from(&self, target_m: &Vector3<f64>) -> Vector3<f64> {
        let begin = |length: LengthKind| length.begins_at(self.position_m, target_m);
        self.reads.map_or(self.position_m, begin)
    }
}

/// The station of a name among those that a task has.
pub fn station_named<'a>(stations: &'a [Station], name: Option<&str>) -> Option<&'a Station> {
    let name = name?;
    stations.iter().find(|station| station.name == name)
}

/// What is wrong with the station of a row, and what to do about it: one that a task with stations has not, or none where it has
/// several. A task without stations takes any word.
pub fn wrong_station(stations: &[Station], found: Option<&str>) -> Option<[String; 2]> {
    let names: Vec<&str> = stations.iter().map(|station| &*station.name).collect();
    let (problem, hint) = match found {
        Some(name) if !names.is_empty() && !names.contains(&name) => {
            let hint = nearest(name, names.iter().copied()).map_or_else(
                || {
                    "a scenario with [[station]] has each station that files of rows name"
                        .to_owned()
                },
                |likely| format!("did you mean {likely:?}?"),
            );
            (format!("found {name:?}"), hint)
        }
        None if names.len() > 1 => (
            "is missing".to_owned(),
            "give the column station".to_owned(),
        ),
        _ => return None,
    };
    let known = names.join(", ");
    Some([
        format!("station: {problem}; the scenario has {known}"),
        hint,
    ])
}
