//! The tables `[[station]]`: where the instrument may stand.

use nalgebra::{Point3, Vector3};

use super::Checker;
use crate::files::FileError;
use crate::mujoco::{Model, Shape, State};
use crate::quantities::limits::MOST_NAMED;
use crate::quantities::plausible::{ANGLE_LIMIT, POSITION, SIZE};
use crate::scenario::file::{File, StationTable};
use crate::task::{AccuracyKind, Station};

/// A reflector can turn away from the instrument by less than this (deg).
const MOST_INCIDENCE_DEG: f64 = 180.0;

impl Checker<'_> {
    /// The stations, none of which is inside anything that stands still. The model's tracker, which carries the site, is no such
    /// thing: it is where the instrument is.
    pub(super) fn stations(
        &self,
        file: &File,
        model: &Model,
        tracker_site: Option<usize>,
    ) -> Result<Vec<Station>, FileError> {
        self.at_most("station", file.station.len(), MOST_NAMED)?;
        if !file.station.is_empty() && file.design.accuracy == AccuracyKind::Relative {
            let problem = "stations are of absolute readings, and design.accuracy is \"relative\"";
            let wrong = self.wrong("station", problem);
            return Err(wrong.hint(
                "set design.accuracy = \"absolute\", or leave them out: deflections are read from instrument.tracker_site",
            ));
        }
        let mut stations: Vec<Station> = Vec::new();
        for (index, table) in file.station.iter().enumerate() {
            let key = format!("station[{index}]");
            let name = &table.name;
            if stations.iter().any(|known| known.name == *name) {
                let problem = format!("found {name:?} twice");
                return Err(self.wrong(&format!("{key}.name"), problem));
            }
            let station = self.station(&key, table)?;
            if let Some(around) = what_is_around(model, tracker_site, &station.position_m) {
                let problem = format!("the place is inside {around}");
                return Err(self.wrong(&format!("{key}.position_mm"), problem));
            }
            stations.push(station);
        }
        Ok(stations)
    }

    fn station(&self, key: &str, table: &StationTable) -> Result<Station, FileError> {
        let position_mm: [f64; 3] =
            self.numbers(&format!("{key}.position_mm"), &table.position_mm, &POSITION)?;
        let bound = |name: &str, value: Option<f64>| {
            let number = |value| self.number(&format!("{key}.{name}"), value, &SIZE);
            value.map(number).transpose()
        };
        let range_mm = [
            bound("range_min_mm", table.range_min_mm)?,
            bound("range_max_mm", table.range_max_mm)?,
        ];
        if let [Some(least), Some(most)] = range_mm
            && least >= most
        {
            let problem = format!("found {most}; more than range_min_mm = {least} is allowed");
            return Err(self.wrong(&format!("{key}.range_max_mm"), problem));
        }
        let incidence = |value: f64| {
            let key = format!("{key}.incidence_max_deg");
            let value = self.number(&key, value, &ANGLE_LIMIT)?;
            if value > 0.0 && value <= MOST_INCIDENCE_DEG {
                return Ok(value.to_radians());
            }
            let problem = format!(
                "found {value}; more than 0 and up to {MOST_INCIDENCE_DEG} deg are allowed: how far a target's z axis may point \
                 past the instrument"
            );
            Err(self.wrong(&key, problem))
        };
        Ok(Station {
            name: table.name.clone(),
            position_m: Vector3::from(position_mm) * 1e-3,
            range_m: range_mm.map(|bound| bound.map(|bound| bound * 1e-3)),
            incidence_max_rad: table.incidence_max_deg.map(incidence).transpose()?,
        })
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
