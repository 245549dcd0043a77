//! Repeated visits of one command pose under one load: repeatability, accuracy and drift (ISO 9283).
//!
//! With the places x of n visits, their mean m and distances l = |x - m|, RP = mean(l) + 3 std(l) at each pose, and AP = |m - p|
//! from the predicted place p. The covariance pooled over all poses, S = sum (x - m)(x - m)^T / sum (n - 1), has an RP of its own,
//! that of a normal x. Drift is the common slope b of x - m over t - mean(t), t the visit's place in the file or its time, by least
//! squares; T^2 = b^T cov(b)^-1 b has Hotelling's distribution where there is none.
//!
//! All of it has the instrument's noise in it. Readings of one visit are averaged first: they say nothing of how a robot returns. What several
//! targets, or loads hung in place, show of one visit tells its drift once.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Matrix3, Vector3};
use serde::Serialize;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use crate::experiment::together;
use crate::measurement::{AbsoluteReading, Measurement, by_experiment};
use crate::numeric::tolerance::pose_repeatability;
use crate::quantities::written::{from_one, thousandfold};

/// Two visits are as far from their mean, and say nothing of how distances scatter.
const FEWEST: usize = 3;
/// The number of coordinates.
const COORDINATES: f64 = 3.0;

/// One visit: where something was read, and when.
#[derive(Debug, Clone, Copy, PartialEq)]
struct RepeatedVisit {
    /// The visit's number.
    number: usize,
    /// The place, or the reading less its prediction (m).
    place_m: Vector3<f64>,
    /// When: rows, or hours.
    at: f64,
}

/// The visits of one pose.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RepeatedPose {
    /// Its first row, from 0; from 1 in records.
    #[serde(serialize_with = "from_one")]
    pub first: usize,
    /// The number of visits.
    pub visits: usize,
    /// RP (m); none of two visits.
    #[serde(rename = "rp_mm", serialize_with = "thousandfold")]
    pub repeatability_m: Option<f64>,
    /// AP (m), where readings are absolute.
    #[serde(rename = "ap_mm", serialize_with = "thousandfold")]
    pub accuracy_m: Option<f64>,
}

/// How the places move over the visits of a file.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PlaceDrift {
    /// What the slope is by: `row`, in the file's order, or `hour`.
    pub by: &'static str,
    /// How far places move (m) in an hour, or from row to row.
    #[serde(rename = "slope_mm", serialize_with = "thousandfold")]
    pub slope_m: Vector3<f64>,
    /// The standard errors.
    #[serde(rename = "standard_error_mm", serialize_with = "thousandfold")]
    pub standard_error_m: Vector3<f64>,
    /// The probability of slopes at least as large where there is no drift; none where the visits are too few.
    pub probability: Option<f64>,
}

/// What repeated visits show.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Repeats {
    /// The poses that were visited more than once; what is read of several targets, each.
    pub poses: Vec<RepeatedPose>,
    /// How many visits of the robot these are.
    pub visits: usize,
    /// RP (m) by the covariance pooled over them.
    #[serde(rename = "rp_mm", serialize_with = "thousandfold")]
    pub repeatability_m: f64,
    /// Its degrees of freedom in each coordinate.
    pub degrees_of_freedom: usize,
    /// The drift, where visits of a pose are apart.
    pub drift: Option<PlaceDrift>,
}

impl Repeats {
    /// Of deflections: two readings each, and no place that is predicted. `None` without repeats, and of displacements along a
    /// direction.
    pub fn of_deflections(measurements: &[Measurement], kept: &[usize]) -> Option<Self> {
        if measurements.iter().any(|each| each.direction.is_some()) {
            return None;
        }
        let own: Vec<Measurement> = kept.iter().map(|&row| measurements[row].clone()).collect();
        let visit = |place: usize| RepeatedVisit {
            number: place,
            place_m: own[place].deflection_m,
            at: kept[place] as f64,
        };
        let poses = by_experiment(&own).into_iter();
        let poses = poses.map(|group| (kept[group[0]], group.into_iter().map(visit).collect()));
        Self::new(poses, false, "row")
    }

    /// Of absolute readings, some of which are kept, by what they are less their predictions (m), with the rows of each visit.
    pub fn of_readings(
        readings: &[AbsoluteReading],
        residuals_m: &[Vector3<f64>],
        kept: &[usize],
        visits: &[Vec<usize>],
    ) -> Option<Self> {
        let read = |place: usize| &readings[kept[place]];
        let is_alike = |one: usize, other: usize| {
            let [one, other] = [one, other].map(read);
            (one.load, &one.target, &one.station) == (other.load, &other.target, &other.station)
        };
        let is_by_hour = readings.iter().all(|reading| reading.time_s.is_some());
        let mut number_of = vec![0; readings.len()];
        for (number, rows) in visits.iter().enumerate() {
            for &row in rows {
                number_of[row] = number;
            }
        }
        let pose = |group: Vec<usize>| {
            let mut visits: BTreeMap<usize, Vec<RepeatedVisit>> = BTreeMap::new();
            for row in group.iter().map(|&place| kept[place]) {
                let time_s = readings[row].time_s.filter(|_| is_by_hour);
                let number = number_of[row];
                visits.entry(number).or_default().push(RepeatedVisit {
                    number,
                    place_m: residuals_m[row],
                    at: time_s.map_or(row as f64, |time_s| time_s / 3600.0),
                });
            }
            let visits = visits.values().map(|rows| mean(rows)).collect();
            (kept[group[0]], visits)
        };
        let groups = together(kept.len(), |place| read(place).pose(), is_alike).into_iter();
        let by = if is_by_hour { "hour" } else { "row" };
        Self::new(groups.map(pose), true, by)
    }

    fn new(
        poses: impl Iterator<Item = (usize, Vec<RepeatedVisit>)>,
        is_absolute: bool,
        by: &'static str,
    ) -> Option<Self> {
        let repeated: Vec<_> = poses.filter(|(_, visits)| visits.len() > 1).collect();
        let count: usize = repeated.iter().map(|(_, visits)| visits.len() - 1).sum();
        if count == 0 {
            return None;
        }
        let mut of_visits: BTreeMap<usize, Vec<RepeatedVisit>> = BTreeMap::new();
        let mut means = BTreeSet::new();
        let mut scatter = Matrix3::zeros();
        for (_, visits) in &repeated {
            means.insert(visits.iter().map(|each| each.number).collect::<Vec<_>>());
            for each in from_mean(visits) {
                scatter += each.place_m * each.place_m.transpose();
                of_visits.entry(each.number).or_default().push(each);
            }
        }
        let pooled = (scatter / count as f64).resize(3, 3, 0.0);
        let apart: Vec<RepeatedVisit> = of_visits.values().map(|each| mean(each)).collect();
        // What several show of the same visits is from one mean.
        let freedom = apart.len().saturating_sub(means.len());
        Some(Self {
            repeatability_m: pose_repeatability(&pooled)?,
            visits: apart.len(),
            degrees_of_freedom: freedom,
            drift: drift(&apart, freedom, by),
            poses: (repeated.into_iter())
                .map(|(first, visits)| RepeatedPose {
                    first,
                    visits: visits.len(),
                    repeatability_m: repeatability_m(&visits),
                    accuracy_m: is_absolute.then(|| mean(&visits).place_m.norm()),
                })
                .collect(),
        })
    }
}

fn mean(visits: &[RepeatedVisit]) -> RepeatedVisit {
    let share = (visits.len() as f64).recip();
    RepeatedVisit {
        number: visits[0].number,
        place_m: visits.iter().map(|each| each.place_m).sum::<Vector3<f64>>() * share,
        at: visits.iter().map(|each| each.at).sum::<f64>() * share,
    }
}

fn from_mean(visits: &[RepeatedVisit]) -> impl Iterator<Item = RepeatedVisit> {
    let mean = mean(visits);
    visits.iter().map(move |each| RepeatedVisit {
        number: each.number,
        place_m: each.place_m - mean.place_m,
        at: each.at - mean.at,
    })
}

fn repeatability_m(visits: &[RepeatedVisit]) -> Option<f64> {
    if visits.len() < FEWEST {
        return None;
    }
    let lengths: Vec<f64> = from_mean(visits).map(|each| each.place_m.norm()).collect();
    let count = lengths.len() as f64;
    let mean = lengths.iter().sum::<f64>() / count;
    let squares: f64 = lengths.iter().map(|length| (length - mean).powi(2)).sum();
    Some(mean + 3.0 * (squares / (count - 1.0)).sqrt())
}

/// The drift of visits, each from the mean of its pose, with so many degrees of freedom in each coordinate.
fn drift(apart: &[RepeatedVisit], freedom: usize, by: &'static str) -> Option<PlaceDrift> {
    let spread: f64 = apart.iter().map(|each| each.at * each.at).sum();
    if spread <= 0.0 || freedom < 2 {
        return None;
    }
    let slope_m: Vector3<f64> = (apart.iter())
        .map(|each| each.place_m * each.at)
        .sum::<Vector3<f64>>()
        / spread;
    let squares = (apart.iter()).map(|each| each.place_m * each.place_m.transpose());
    let scatter: Matrix3<f64> = squares.sum();
    let freedom = freedom as f64 - 1.0;
    let covariance = (scatter - slope_m * slope_m.transpose() * spread) / (freedom * spread);
    Some(PlaceDrift {
        by,
        slope_m,
        standard_error_m: (covariance.diagonal()).map(|variance| variance.max(0.0).sqrt()),
        probability: covariance.cholesky().and_then(|factor| {
            let square = slope_m.dot(&factor.solve(&slope_m));
            let others = freedom - COORDINATES + 1.0;
            let distribution = FisherSnedecor::new(COORDINATES, others).ok()?;
            Some(distribution.sf(square * others / (COORDINATES * freedom)))
        }),
    })
}
