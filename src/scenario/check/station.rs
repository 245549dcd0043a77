//! The tables `[[station]]`: where the instrument may stand.

use nalgebra::{Point3, Vector3};

use super::Checker;
use crate::files::FileError;
use crate::mujoco::{Model, Shape, State};
use crate::quantities::limits::MOST_NAMED;
use crate::quantities::plausible::{INCIDENCE, SIZE};
use crate::scenario::file::{File, StationReads, StationTable};
use crate::task::{AccuracyKind, Instrument, Station};

impl Checker<'_> {
    /// The stations, none of which is inside anything that stands still. The model's tracker, which carries the site, is no such
    /// thing: it is where the instrument is.
    pub(super) fn stations(
        &self,
        file: &File,
        model: &Model,
        instrument: &Instrument,
    ) -> Result<Vec<Station>, FileError> {
        let names = file.station.iter().map(|each| &each.name);
        self.named("station", MOST_NAMED, names)?;
        if !file.station.is_empty() && file.design.accuracy == AccuracyKind::Relative {
            let problem = "stations are of absolute readings, and design.accuracy is \"relative\"";
            let wrong = self.wrong("station", problem);
            return Err(wrong.hint(
                "set design.accuracy = \"absolute\", or leave them out: deflections are read from instrument.tracker_site",
            ));
        }
        let stations = self.each("station", MOST_NAMED, &file.station, |key, table| {
            let position = format!("{key}.position_mm");
            let position_m = self.position(&position, &table.position_mm)?;
            if let Some(around) = what_is_around(model, instrument.tracker_site, &position_m) {
                let problem = format!("the place is inside {around}");
                return Err(self.wrong(&position, problem));
            }
            let range_mm = [table.range_min_mm, table.range_max_mm];
            let incidence = format!("{key}.incidence_max_deg");
            let incidence_deg = self.optional(&incidence, table.incidence_max_deg, &INCIDENCE)?;
            Ok(Station {
                name: table.name.clone(),
                reads_distances: self.reads_distances(key, table, instrument)?,
                position_m,
                range_m: self.lengths(&format!("{key}.range"), range_mm, &SIZE)?,
                incidence_max_rad: incidence_deg.map(f64::to_radians),
            })
        })?;
        if file.instrument.distance.is_some() && !stations.iter().any(|each| each.reads_distances) {
            let problem = "is given, and distances are read from no [[station]]";
            let wrong = self.wrong("instrument.distance", problem);
            return Err(wrong.hint("give those of a bar or a wire reads = \"distance\""));
        }
        Ok(stations)
    }

    /// Whether distances are read from a station: where it says so, or where the instrument reads nothing else.
    fn reads_distances(
        &self,
        key: &str,
        table: &StationTable,
        instrument: &Instrument,
    ) -> Result<bool, FileError> {
        use StationReads::{Distance, Position};
        let wrong = |name: &str, problem: &str| self.wrong(&format!("{key}.{name}"), problem);
        match table.reads {
            Some(Distance) if instrument.distance.is_none() => {
                let problem = "is \"distance\", and nothing says how precise distances are";
                let hint = "give the table [instrument.distance] beside a tracker, or instrument.reads = \"distance\"";
                Err(wrong("reads", problem).hint(hint))
            }
            Some(Position) if !instrument.reads_positions() => {
                let problem = "is \"position\", and instrument.reads is \"distance\"";
                let hint = "give a tracker's [instrument], and [instrument.distance] for distances beside it";
                Err(wrong("reads", problem).hint(hint))
            }
            Some(Distance) if table.range_max_mm.is_none() => {
                let problem = "is missing: how far what reads distances reaches";
                Err(wrong("range_max_mm", problem))
            }
            Some(reads) => Ok(reads == Distance),
            None => Ok(!instrument.reads_positions()),
        }
    }
}

/// What a point (m, world frame) is inside of, of all that no joint moves; meshes are not looked into.
fn what_is_around(
    model: &Model,
    tracker_site: Option<usize>,
    point_m: &Vector3<f64>,
) -> Option<String> {
    let mut state = State::new(model);
    state.update_kinematics();
    let tracker = tracker_site.map(|site| (model.site_body(site).0, state.site(site).0));
    let is_inside = |id: usize, shape: &Shape, point_m: &Vector3<f64>| {
        let local = state.geometry_pose(id).inverse() * Point3::from(*point_m);
        shape.has_inside(&local.coords)
    };
    let around = model.scenery().into_iter().find(|each| {
        let body = model.geometry_body(each.id);
        let is_tracker = tracker.is_some_and(|(tracker, position_m)| {
            (body == tracker && body != 0) || is_inside(each.id, &each.shape, &position_m)
        });
        model.joints_that_move(body) == 0 && !is_tracker && is_inside(each.id, &each.shape, point_m)
    })?;
    Some(around.name)
}
