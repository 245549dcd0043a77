//! The tables `[[station]]`: where the instrument may stand.

use nalgebra::{Point3, Vector3};

use super::Checker;
use super::number::position_m;
use crate::files::FileError;
use crate::mujoco::{Model, Shape, State};
use crate::observation::LengthKind;
use crate::quantities::limits::MOST_NAMED;
use crate::scenario::file::{File, StationTable};
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
            let position_m = position_m(&table.position_mm);
            if let Some(around) = what_is_around(model, instrument.tracker_site, &position_m) {
                let problem = format!("the place is inside {around}");
                return Err(self.wrong(&position, problem));
            }
            let range_mm = [table.range_min_mm, table.range_max_mm];
            Ok(Station {
                name: table.name.clone(),
                reads: self.length_from(key, table, instrument)?,
                position_m,
                range_m: self.lengths(&format!("{key}.range"), range_mm)?,
                incidence_max_rad: table.incidence_max_deg.map(f64::to_radians),
            })
        })?;
        for kind in LengthKind::ALL {
            let name = kind.name();
            let is_read = stations.iter().any(|each| each.reads == Some(kind));
            if file.instrument.length(kind).is_some() && !is_read {
                let problem = format!("is given, and {name}s are read from no [[station]]");
                let wrong = self.wrong(&format!("instrument.{name}"), problem);
                return Err(wrong.hint(format!("give those of what reads them reads = {name:?}")));
            }
        }
        Ok(stations)
    }

    /// The lengths that are read from a station: where it says so, or where the instrument reads nothing else.
    fn length_from(
        &self,
        key: &str,
        table: &StationTable,
        instrument: &Instrument,
    ) -> Result<Option<LengthKind>, FileError> {
        let wrong = |name: &str, problem: String| self.wrong(&format!("{key}.{name}"), problem);
        let alone = instrument.length_alone();
        let Some(reads) = table.reads else {
            return Ok(alone);
        };
        let length = LengthKind::named(reads.into());
        let Some(kind) = length else {
            return match alone.map(LengthKind::name) {
                None => Ok(None),
                Some(name) => {
                    let problem = format!("is \"position\", and instrument.reads is {name:?}");
                    let hint = format!(
                        "give a tracker's [instrument], and [instrument.{name}] for {name}s beside it"
                    );
                    Err(wrong("reads", problem).hint(hint))
                }
            };
        };
        let name = kind.name();
        if instrument.shows_length(kind).is_none() {
            let problem = format!("is {name:?}, and nothing says how precise {name}s are");
            let hint = format!(
                "give the table [instrument.{name}] beside a tracker, or instrument.reads = {name:?}"
            );
            return Err(wrong("reads", problem).hint(hint));
        }
        if table.range_max_mm.is_none() {
            let problem = format!("is missing: how far what reads {name}s reaches");
            return Err(wrong("range_max_mm", problem));
        }
        Ok(length)
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
