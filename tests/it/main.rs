//! Tests from outside the library, in one binary.
//!
//! - `absolute_readings`: files of positions and poses in the instrument's own frame.
//! - `published`: numbers that the paper prints, with the tolerance that its printing supports.
//! - `joint_errors`: what joints are off by is corrected for absolute targets, and named elsewhere.
//! - `judges`: the analytic model and MuJoCo judge each other.
//! - `recordings`: the rerun and MCAP files, read with their own tools.
//! - `absolute_priors`: what absolute readings found is what another campaign knows.
//! - `ranks`: true values lie evenly in what is known of them.
//! - `repeats`: what repeats of an experiment share they do not average.
//! - `unknowns`: unknowns besides compliances, found from measurements.
//! - `recovery`: known compliances come back, and hand-computed small cases.
//! - `directions`: accuracy along a direction alone, and targets in the tool's frame.
//! - `tolerances`: what 95 % of calibrations stay below, predicted and seen.
//! - `uncertainties`: what nobody knows exactly: drawn in truth, carried by the belief, and kept in predictions.
//! - `unread`: what is uncertain and no reading shows: the task's force, masses of links.
//! - `uncertainty`: the predicted uncertainties are seen over many seeded runs.
//! - `uncertainty_budget`: squares of contributions add up to the predicted accuracy, for every kind of source.
//! - `hung_in_place`: absolute readings under several loads in one visit.
//! - `identifiability`: what measurements cannot tell is named.
//! - `determined`: every command names the same compliances as not determined.
//! - `compensation_trust`: what `compensate` makes of files that it should not trust.
//! - `coarse_steps`: repeats that share errors of rounding, and what predictions, fits and bounds make of it.
//! - `codes`: conditions and errors have codes that are explained; `explain`, `--allow`.
//! - `command_line`: the commands, seen from outside the process.
//! - `calibrated_robots`: a robot from absolute readings as a model, and compensated with.
//! - `init`: a first scenario for models of all kinds, and URDF.
//! - `absolute_runs`: the whole loop with absolute readings is what its commands are one by one.
//! - `absolute_studies`: studies of absolute plans, and their pages.
//! - `next_readings`: which absolute readings to take next.
//! - `absolute_campaigns`: plans of absolute readings in the laboratory, and their tables to fill in.
//! - `rails`: joints that slide are read, told and kept within their ends in their own unit.
//! - `absolute_targets`: compensated angles for absolute poses.
//! - `exported_models`: the calibrated robot as MJCF, read again.
//! - `foreign_tables`: tables of other programs become measurement files.
//! - `patterns`: what residuals go with is named where there is something.
//! - `inconsistencies`: two series, or the halves of one, that cannot both be right.
//! - `model_selection`: models with more and more parameters, compared by blocks of joint space.
//! - `gate`: comparing results against tolerances, seen from outside the process.
//! - `gate_refusals`: results and tolerances that cannot be compared.
//! - `input_errors`: wrong tables of absolute readings: the error is named; gross errors, copies, what is hardly told.
//! - `installed`: the program with its scenarios outside of a clone, and scenarios for other versions.
//! - `interruptions`: studies that are killed, disks that fill up.
//! - `output_files`: where results go: devices, links, modes; no output overwrites an input.
//! - `error_sources`: pictures of where the error comes from, in pages and recordings.
//! - `faults`: killed, interrupted, out of space, two at once, odd names, at random moments.
//! - `braced_arms`: springs beside the joints' own in planning and torque bounds.
//! - `broken_streams`: stdout and stderr that nobody reads or that are full.
//! - `old_files`: the program's own files of other versions, and names in them.
//! - `parameters`: derivatives by any parameter beside MuJoCo's Jacobians.
//! - `priors`: an earlier identification as what is known before.
//! - `properties`: what holds whatever the numbers are; derivatives against differences.
//! - `ballbars`: distances from places in the room: predictions, files, refusals.
//! - `known_places`: cups and tables that are known before.
//! - `ballbar_robots`: what is identified from distances of which visits share errors, predicted, compared and chosen.
//! - `bad_input`: wrong inputs, seen from outside the process.
//! - `measured_rotations`: planning, studies and identification use measured rotations alike.
//! - `plan_conditions`: what is said of a plan before its accuracy is relied on; repeats beside their bound.
//! - `planned_readings`: what else is uncertain where rotations are measured, and on arms with springs.
//! - `bad_starts`: absolute fits that begin far from the truth.
//! - `small_arms`: arms of four joints where one term of a prediction decides; campaigns on one virtual robot.
//! - `simulated`: files by the hundred: false alarms, patterns that are found, models that are chosen.
//! - `backlash`: gaps of joints: sides of approach in files, belief and truth, and loads that turn joints over.
//! - `kept_gears`: transmission errors that robots keep as functions of angles, in predictions, plans and virtual robots of absolute readings.
//! - `gear_waves`: gear error as waves over the joint's own angle, in predictions and found in absolute readings.
//! - `model_features`: what models can say beside the chain: honoured or refused by name.
//! - `model_messages`: models that cannot serve, and what to do about them.
//! - `few_readings`: wrong readings of an arm with a slide, among few and many, spread or in one place.
//! - `robust_deflections`: wrong deflections and discrepancy in fits of deflections.
//! - `stiffening`: joints that stiffen or soften by a share that nobody knows, by their law and as a parameter.
//! - `stored_robots`: a robot that was identified, read from its file; moved stations.
//! - `structured_discrepancy`: robots that are not as their model: regions, intervals and wrong readings.
//! - `wrong_readings`: left out of model selection, patterns and inconsistencies, and named.
//! - `ur10_measured`: real poses of a UR10, where they are there.
//! - `validation`: other measurements check what an identification predicts.
//! - `understanding`: what `check` says that it understood, and likely mistakes.
//! - `csv_dialects`: plans and measurements as spreadsheets of every country write them.
//! - `diagnoses`: likely input errors of deflections, and residuals.
//! - `one_fit`: frames, geometry and elasticity from absolute readings, in one fit.
//! - `other_truths`: virtual robots that differ from the planner's model.
//! - `origins`: files say under which scenario they were made; help says what has an effect.
//! - `hostile_input`: names, fields and numbers that somebody means ill with.
//! - `implausible_input`: inputs that are well formed and cannot be.
//! - `mutations`: a hundred thousand broken inputs, and every one that ever failed.
//! - `laboratory`: order, ways, robot programs, run sheet: a plan goes to the laboratory.
//! - `limits`: sizes, and files without an end.
//! - `tallies`: tallies that cannot be.
//! - `compensator`: the KR-270 with a gravity compensator and flexible parts; what a belief without them costs.
//! - `documentation`: README and `docs/`: length, links, commands and options.
//! - `elastic_beliefs`: beliefs with passive joints, slides, springs, locked branches, tools and payloads.
//! - `true_models`: virtual robots that are more than a chain, beside MuJoCo's simulation in time.
//! - `known_optima`: arms of three joints, for which the best plan can be derived by hand.
//! - `selection`: choices of readings, calibrated with and judged on all others.
//! - `schema`: the JSON schema of scenarios.
//! - `search`: the search for plans and its certificate, on the KR-270.
//! - `bounds`: the class of plans that a bound speaks about.
//! - `left_out`: what a proof takes for certain, by name.
//! - `proofs`: the bound that is proved, and its proof checked by another program.
//! - `absolute_plans`, `absolute_predictions`, `absolute_trials`, `stations`: plans of absolute readings, robots that err as they predict,
//!   virtual ones of the program among them, and where the instrument stands.
//! - `held_robots`: experiments that the robot must hold, and what is far from usual sizes.
//! - `chains`: what a command writes the next one reads, whatever is uncertain.
//! - `candidates`: plans that are chosen from a list, held to all plans that there are of it.
//! - `criteria_bounds`: the bounds by other criteria than `rho_0`.
//! - `force_sizes`: the size of a force is a variable of the design; optima derived by hand.
//! - `provenance`: what results depend on is in their hash.
//! - `load_sets`: one load set decides for plans, measurements and mandatory experiments.
//! - `nonlinear_gap`: where a prediction is off because the model is not linear.
//! - `torque_laws`: joints of the virtual robot that are no springs, at rest, in time and in studies.
//! - `next`: what to measure next, after some of a plan is measured.
//! - `raw_readings`: positions without and with a load in place of deflections.
//! - `obstacles`: what stands in the laboratory.
//! - `streams`: a study's recordings, live in a viewer and as files.
//! - `reproduction`: the paper's numbers beside the program's, by the program.
//! - `report`: pages to look at, and a browser that looks at them.
//! - `study`: Monte Carlo studies keep what was predicted, to the bit whatever the threads.
//! - `run_truth`: what is shown beside estimates is what that run sampled.
//! - `rooms`: modules use only those that stand before them.

#![expect(clippy::expect_used, reason = "a test that cannot go on fails")]

mod absolute_campaigns;
mod absolute_plans;
mod absolute_predictions;
mod absolute_priors;
mod absolute_readings;
mod absolute_runs;
mod absolute_studies;
mod absolute_targets;
mod absolute_trials;
mod backlash;
mod bad_input;
mod bad_starts;
mod ballbar_robots;
mod ballbars;
mod bounds;
mod braced_arms;
mod broken_streams;
mod browser;
mod calibrated_robots;
mod candidates;
mod certificates;
mod chains;
mod coarse_steps;
mod codes;
mod command_line;
mod compensation_trust;
mod compensator;
mod configurations;
mod criteria_bounds;
mod csv_dialects;
mod determined;
mod diagnoses;
mod directions;
mod documentation;
mod elastic_beliefs;
mod error_sources;
mod exported_models;
mod extrapolation;
mod faults;
mod few_configurations;
mod few_readings;
mod force_sizes;
mod foreign_tables;
mod gate;
mod gate_refusals;
mod gauges;
mod gear_waves;
mod heights;
mod held_robots;
mod hostile_input;
mod hung_in_place;
mod identifiability;
mod implausible_input;
mod inconsistencies;
mod init;
mod input_errors;
mod installed;
mod interruptions;
mod joint_errors;
mod joint_functions;
mod judge;
mod judges;
mod kept_gears;
mod kept_models;
mod known_optima;
mod known_places;
mod laboratory;
mod left_out;
mod limits;
mod load_sets;
mod measured_rotations;
mod mixed_readings;
mod model_features;
mod model_messages;
mod model_selection;
mod mutations;
mod next;
mod next_readings;
mod nonlinear_gap;
mod obstacles;
mod old_files;
mod one_fit;
mod origins;
mod other_truths;
mod output_files;
mod parameters;
mod patterns;
mod plan_conditions;
mod planned_readings;
mod planning;
mod priors;
mod proofs;
mod properties;
mod provenance;
mod published;
mod rails;
mod random_models;
mod ranks;
mod raw_readings;
mod recordings;
mod recovery;
mod repeat_components;
mod repeated_visits;
mod repeats;
mod report;
mod reproduction;
mod robots;
mod robust_deflections;
mod rooms;
mod run_truth;
mod schema;
mod search;
mod selection;
mod simulated;
mod small_arms;
mod static_compliance;
mod stations;
mod stiffening;
mod stored_robots;
mod streams;
mod structured_discrepancy;
mod study;
mod support;
mod tallies;
mod tolerances;
mod torque_laws;
mod true_models;
mod uncertainties;
mod uncertainty;
mod uncertainty_budget;
mod understanding;
mod unknowns;
mod unread;
mod ur10_measured;
mod validation;
mod visits;
mod wrong_readings;
