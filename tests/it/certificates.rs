//! Input as certificates print it: maximum permissible errors, and pose repeatability.

use elastocal::numeric::random::generator;
use elastocal::parameter::{ReadingSource, Source, TransmissionError, Uncertainty};
use elastocal::scenario::Scenario;
use nalgebra::Vector3;
use rand_distr::{Distribution, StandardNormal};

use crate::support::Workplace;
use crate::uncertainties::{assert_refused, entry, loaded, with};

/// The paper's scenario with a tracker and with error sources.
fn laboratory(uncertainties: &str) -> String {
    let text = with(uncertainties, "model", 64);
    text.replace("[instrument]", "[instrument]\ntracker_site = \"tracker\"")
}

/// The standard deviations of an error source, in SI units.
fn sizes(source: &Source) -> Vec<f64> {
    match source {
        Source::Plan(parameters) => parameters.iter().map(|(_, size)| *size).collect(),
        Source::Reading(
            ReadingSource::JointRepeatability(all)
            | ReadingSource::TransmissionError(TransmissionError {
                deviations: all, ..
            }),
        ) => all.clone(),
        Source::Reading(
            ReadingSource::LoadDirection(size)
            | ReadingSource::LoadPoint(size)
            | ReadingSource::GaugeDirection(size),
        ) => vec![*size],
        Source::Reading(ReadingSource::Discrepancy(error)) => vec![error.deviation_m],
        Source::Reading(ReadingSource::Range(noise)) => {
            vec![noise.per_metre, noise.along_per_metre]
        }
    }
}

fn only(text: &str) -> Uncertainty {
    let mut all = loaded(&laboratory(text)).truth.uncertainties;
    assert_eq!(all.len(), 1, "{text}");
    all.remove(0)
}

fn assert_same(one: &str, other: &str) {
    let [one_of, others] = [one, other].map(|text| sizes(&only(text).source));
    assert_eq!(one_of.len(), others.len(), "{one}{other}");
    for (found, expected) in one_of.iter().zip(&others) {
        let is_same = (found - expected).abs() <= 1e-12 * expected.abs();
        assert!(is_same, "{one}{other}{found} {expected}");
    }
}

#[test]
fn a_maximum_permissible_error_becomes_its_standard_uncertainty() {
    let says = [
        ("distribution = \"uniform\"", 3.0_f64.sqrt()),
        ("distribution = \"triangular\"", 6.0_f64.sqrt()),
        ("coverage_factor = 2", 2.0),
        ("distribution = \"normal\"\ncoverage_factor = 3", 3.0),
    ];
    for (index, (kind, mpe, key, standard)) in [
        ("load_scale", "mpe_relative = 0.01", "std_relative", 0.01),
        ("load_offset", "mpe_n = 6", "std_n", 6.0),
        ("tool_position", "mpe_um = 90", "std_mm", 0.09),
        ("joint_zero", "mpe_mrad = 0.3", "std_mrad", 0.3),
        ("backlash", "mpe_arcsec = 60", "std_arcsec", 60.0),
        ("drift", "mpe_um_per_h = 20", "std_um_per_h", 20.0),
        ("discrepancy", "mpe_um = 40", "std_mm", 0.04),
        // A certificate is of one reading, and two make a deflection.
        (
            "tracker_range",
            "mpe_um_per_m = 6",
            "std_um_per_m",
            6.0 * 2.0_f64.sqrt(),
        ),
    ]
    .into_iter()
    .enumerate()
    {
        let (distribution, divisor) = says[index % says.len()];
        let given = format!("{mpe}\n{distribution}");
        let meant = format!("{key} = {:e}", standard / divisor);
        assert_same(&entry((kind, &given), ""), &entry((kind, &meant), ""));
    }
    let both = "mpe_um_per_m = 6\nmpe_along_um_per_m = 0.3\ncoverage_factor = 2";
    let found = sizes(&only(&entry(("tracker_range", both), "")).source);
    assert!((found[0] / found[1] - 20.0).abs() < 1e-12, "{found:?}");
    // Gears err by configurations, and waves of theirs for as long as the robot lasts.
    let waves = "mpe_mrad = 0.1\ncoverage_factor = 2\nharmonics = [1]";
    assert_same(
        &entry(("transmission_error", waves), ""),
        &entry(
            ("transmission_error", "std_mrad = 0.05\nharmonics = [1]"),
            "",
        ),
    );
}

#[test]
fn an_instrument_may_be_given_by_its_certificate() {
    let text = with("", "model", 64);
    let of = |says: &str| {
        loaded(&text.replace("sigma_mm = 0.03", says))
            .task
            .belief
            .instrument
    };
    let mpe = "mpe_um = 60\ncoverage_factor = 2\nrotation_mpe_mrad = 0.2";
    let expected = of("sigma_mm = 0.03\nrotation_sigma_mrad = 0.1");
    assert!((of(mpe).sigma_m / expected.sigma_m - 1.0).abs() < 1e-12);
    assert_eq!(of(mpe).rotation_sigma_rad, expected.rotation_sigma_rad);
    let of_bounds = |word: &str| of(&format!("mpe_um = 60\ndistribution = \"{word}\""));
    let [uniform, rectangular] = ["uniform", "rectangular"].map(of_bounds);
    assert_eq!(uniform.sigma_m.to_bits(), rectangular.sigma_m.to_bits());
    let place = Workplace::new();
    for (says, problems) in [
        ("", ["instrument.sigma_mm", "is missing"]),
        (
            "sigma_mm = 0.03\nmpe_um = 60\ncoverage_factor = 2",
            ["instrument.mpe_um", "sigma_mm is given, too"],
        ),
        (
            "sigma_mm = 0.03\ncoverage_factor = 2",
            ["instrument.coverage_factor", "none is given"],
        ),
    ] {
        place.write("wrong.toml", text.replace("sigma_mm = 0.03", says));
        let said = place.refused("check wrong.toml").stderr;
        assert!(problems.iter().all(|each| said.contains(each)), "{said}");
    }
}

#[test]
fn wrong_certificates_are_refused_by_name() {
    for (entry, key, says) in [
        (
            "mpe_relative = 0.01",
            "distribution",
            "is missing, and so is coverage_factor",
        ),
        (
            "mpe_relative = 0.01\ndistribution = \"uniform\"\ncoverage_factor = 2",
            "coverage_factor",
            "beside a distribution with bounds",
        ),
        (
            "mpe_relative = 0.01\ndistribution = \"normal\"",
            "coverage_factor",
            "a normal distribution has no bounds",
        ),
        (
            "mpe_relative = 0.01\ncoverage_factor = -2",
            "coverage_factor",
            "found -2",
        ),
        (
            "mpe_relative = -0.01\ncoverage_factor = 2",
            "mpe_relative",
            "found -0.01",
        ),
        (
            "mpe_relative = 0.01\nstd_relative = 0.01\ncoverage_factor = 2",
            "mpe_relative",
            "std_relative is given, too",
        ),
        (
            "mpe_um = 10\ncoverage_factor = 2",
            "mpe_um",
            "a load_scale has no such key; it has std_relative",
        ),
        (
            "std_relative = 0.01\ncoverage_factor = 2",
            "coverage_factor",
            "none is given",
        ),
    ] {
        assert_refused(&format!("kind = \"load_scale\"\n{entry}"), key, says);
    }
}

/// RP of visits to a pose (ISO 9283): joints that are drawn, the first-order motion of the tool, distances from the centre.
fn drawn_rp_mm(scenario: &Scenario, deviations: &[f64], q_deg: &[f64]) -> f64 {
    let belief = &scenario.task.belief;
    let q: Vec<f64> = q_deg.iter().map(|angle| angle.to_radians()).collect();
    let state = belief.nominal.chain.at(&belief.machining_tool).state(&q);
    let mut random = generator(3, 0);
    let count = 200_000;
    let lengths: Vec<f64> = (0..count)
        .map(|_| {
            let moved: Vector3<f64> = (deviations.iter().enumerate())
                .map(|(joint, deviation)| {
                    let normal: f64 = StandardNormal.sample(&mut random);
                    // One of the two visits that a deflection takes.
                    state.position_column(joint) * (deviation * normal / 2.0_f64.sqrt())
                })
                .sum();
            moved.norm() * 1e3
        })
        .collect();
    let mean = lengths.iter().sum::<f64>() / f64::from(count);
    let square = lengths.iter().map(|l| (l - mean).powi(2)).sum::<f64>() / f64::from(count);
    mean + 3.0 * square.sqrt()
}

#[test]
fn joints_return_so_that_the_tool_has_its_pose_repeatability() {
    let here = [0.0, -56.9, 89.3, 45.1, 76.0, 57.2];
    for (more, moved) in [("", 6), ("joints = [\"joint_2\", \"joint_3\"]", 2)] {
        let text = entry(("joint_repeatability", "rp_mm = 0.06"), more);
        let deviations = sizes(&only(&text).source);
        let scenario = loaded(&laboratory(&text));
        let own: Vec<f64> = deviations
            .iter()
            .copied()
            .filter(|size| *size > 0.0)
            .collect();
        assert_eq!(own.len(), moved, "{more}");
        assert!(
            own.iter().all(|size| size.total_cmp(&own[0]).is_eq()),
            "{deviations:?}"
        );
        let found = drawn_rp_mm(&scenario, &deviations, &here);
        assert!((found / 0.06 - 1.0).abs() < 0.01, "{more}: {found}");
    }
}

#[test]
fn wrong_repeatabilities_are_refused_by_name() {
    for (entry, key, says) in [
        ("rp_mm = -0.06", "rp_mm", "found -0.06"),
        (
            "rp_mm = 0.06\nstd_mrad = 0.03",
            "rp_mm",
            "beside a standard deviation",
        ),
        ("rp_mm = 0.06\njoints = [\"joint_9\"]", "joints", "joint_9"),
        (
            "rp_mm = 0.06\njoints = [\"joint_6\"]",
            "rp_mm",
            "none of the joints moves",
        ),
    ] {
        assert_refused(
            &format!("kind = \"joint_repeatability\"\n{entry}"),
            key,
            says,
        );
    }
}

/// What is of one of the two readings of a deflection is so for all that the instrument reads.
#[test]
fn rotations_are_of_what_coordinates_are_of() {
    let text = with("", "model", 64).replace("sigma_mm", "rotation_sigma_mrad = 0.02\nsigma_mm");
    let of = |word: &str| {
        let text = text.replace("\"deflection\"", &format!("\"{word}\""));
        let instrument = loaded(&text).task.belief.instrument;
        let rotation = instrument.rotation_sigma_rad.expect("rotations");
        [instrument.sigma_m, rotation]
    };
    let (deflection, position) = (of("deflection"), of("position"));
    for (one, both) in deflection.iter().zip(position) {
        assert!((both / one - 2.0_f64.sqrt()).abs() < 1e-12, "{one} {both}");
    }
}
