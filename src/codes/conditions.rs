//! The table of conditions.

codes! {
    /// What can speak against a result that is there.
    ConditionCode {
        PlanUnidentifiable = "C0101", "parameter that the plan does not determine",
            "The information matrix of the plan, prior included, is singular along this parameter: it lies in the unidentifiable \
            subspace (null space), and no number is given for it. Add configurations or loads in which it moves the readings, or take \
            it out of robot.parameters.";
        Violation = "C0102", "plan outside its region",
            "An experiment violates a bound of the region: joint limits, tool elevation, clearance, torque, line of sight, a load \
            outside the load set. The violations say which, with value and bound. Change the experiment, or the bound in [region] or [design].";
        NearConfigurations = "C0103", "independent discrepancies of neighbouring configurations",
            "Configurations within 5 deg (0.087 m of a slide) of each other in all joints are counted with independent model discrepancies, \
            although a robot's are correlated there. The condition gives rho0 as counted, and with one discrepancy for each such group. \
            Move the configurations apart, or rely on the larger number.";
        NoGain = "C0104", "compensation without gain",
            "The predicted residual error rho0 exceeds half of the rms deflection by the task load: compensation with this plan \
            improves next to nothing. The usual cause is a load in another unit (kN), or an error source that dominates; see the \
            uncertainty budget.";
        LoadOutside = "C0105", "load outside the load set",
            "Loads of plan or measurements are none that [load] allows, beyond the rounding of printed plans. \
            Accuracy and identification count the loads as they are; bounds are for the load set. Correct the file's loads, \
            or list them in the scenario.";
        SearchStopped = "C0106", "search stopped early",
            "The search was interrupted by ctrl-C or SIGTERM and returns the best that it had found: a better plan, or plans of more \
            measurements, may exist. Bounds that are given hold. Search again for the full result.";
        OutOfReach = "C0107", "accuracy out of reach",
            "No plan of as many measurements as are allowed has a predicted accuracy as wanted. \
            Allow more measurements, reduce the largest contributions of the uncertainty budget, or accept less.";
        NoWay = "C0108", "no way between configurations",
            "No collision-free way was found between two stops of the campaign, or back to its first safe pose, with the clearances of \
            [laboratory]. Times and programs lack that way. Name safe poses in between, or move the experiment.";
        OneSidedApproach = "C0109", "no room to approach from one side",
            "Before these experiments the joints have no room for the approach of [laboratory] within limits and clearances, so that \
            backlash may have either sign. Shorten the approach, or move the experiments away from the limits.";
        Unidentifiable = "C0201", "parameter that the measurements do not determine",
            "The measurements leave this parameter, or a combination of parameters, in the unidentifiable subspace (null space): it \
            has no estimate, is null in JSON, and keeps its nominal value. Measure configurations and loads in which it moves the readings, \
            or give it a prior.";
        ImpossibleCompliance = "C0202", "compliance that no joint has",
            "The estimate of a joint's compliance is negative, or outside of 1e-15 to 1e3 rad/(N m). Commands that take an identified \
            file replace it by the nominal value and condition the other parameters on that. Measure again with loads that bend this joint; \
            look for signs, units, frames and features that the model lacks.";
        NegativeCompliance = "C0203", "compliance negative beyond noise",
            "The estimate of a compliance is below zero by more than 3.7 standard errors (p = 1e-4): noise does not explain it, and the \
            nominal value is kept. Look for signs, units, frames and features that the model lacks.";
        AllUncertain = "C0204", "no compliance determined better than its nominal value",
            "The fit leaves every compliance uncertain by more than its nominal value: holding such at nominal, as is done otherwise, would \
            leave none to identify. The estimates are given as they are. Measure more, or with larger loads.";
        ResidualsTooLarge = "C0205", "residuals too large",
            "The chi-square of the residuals is improbable for the stated standard deviations (p < 1e-4). A model discrepancy is then added \
            to the weights; it stays a note up to 5 % of the deflections (rms), or 2 mm per metre of reach for absolute readings. \
            Beyond that, or with --noise-only, look for signs, units, frames, a wrong sigma and features that the model lacks.";
        ResidualsTooSmall = "C0206", "residuals too small",
            "The chi-square of the residuals is improbably small for the stated sigma (p < 1e-4). \
            Deflections are in another unit, sigma is too large, or the readings were simulated without noise.";
        Outliers = "C0207", "many outliers",
            "More than 5 % of the readings have residuals beyond 5 standard deviations (p = 6e-7 each) of a robust fit, and are not \
            fitted; fewer are a note. The list gives their numbers with the standardised residuals. Look at them for gross errors; --keep-all fits them.";
        CopiedRows = "C0208", "copied rows",
            "Rows agree in angles, load and reading to the last digit more often than rounding explains (p < 1e-6): copies are no \
            repeats, and would make the standard errors too small. Absolute fits count each once; take them out of the file.";
        CopiedReadings = "C0209", "copied readings",
            "Rows of other angles or loads have the same reading to the last digit more often than rounding explains (p < 1e-6). \
            One was copied over the other: look them up in the instrument's records.";
        InputError = "C0210", "likely input error",
            "One error of unit, sign, frame, order or column explains the file far better than reading it as it is: by a factor of a \
            million in evidence with half the rms residual, or, for absolute readings, with a quarter of what frames alone leave. \
            The condition says what to change; check that before doing so.";
        AnglesOutsideLimits = "C0211", "measured outside the joint limits",
            "Commanded angles of the measurements are outside the joint limits of the model. Check unit, sign and order of the angles' \
            columns, and the limits of the model.";
        ControllerCompensates = "C0212", "compensated by the controller",
            "The measurement file says that the controller compensated deflections itself (KUKA: $ABS_ACCUR). The readings then show its \
            residual error and no compliance. Switch that off and measure again.";
        Inconsistency = "C0213", "inconsistency between series",
            "Two series of readings, or the halves of joint space of one, give estimates of a parameter that differ by more than \
            their uncertainties (Student's t, Bonferroni over all parameters compared, p < 0.01). Something changed between them, or the model \
            lacks something that differs between them.";
        GeometryBeyondTolerance = "C0214", "geometry beyond manufacturing tolerances",
            "A joint zero or link rotation is corrected by more than 0.05 rad, or a link position by more than 20 mm, and by more than \
            2 standard errors. Check signs, zeros, order and units of the joint angles, and the model.";
        MassFarFromPrior = "C0215", "mass far from its prior",
            "A mass or centre of mass is more than 2 prior standard deviations from its prior mean. Gravity determines masses weakly, \
            so that they absorb errors of geometry and elasticity. Weigh the payload, or leave it out of --parameters.";
        PredictionFailed = "C0301", "measurements against prediction",
            "The differences between measurements and prediction have p < 1e-3 (chi-square with the covariance of identification and \
            readings). The identification does not hold for these measurements: look for what has changed, and identify anew.";
        Coverage = "C0302", "coverage of prediction regions",
            "Of at least 20 readings fewer than 80 % lie in their predicted 95 % regions. The uncertainty of the identified robot is too \
            small for these readings: look for what has changed, and for configurations that were not covered when it was identified.";
        StationMoved = "C0303", "station moved",
            "The instrument's station is not where it was identified: by more than its uncertainty (p < 1e-6) and the model \
            discrepancy. Give these readings a station name of their own, and its frame is fitted to them.";
        BeyondLimits = "C0304", "command beyond joint limits",
            "Compensation at a test pose commands a joint beyond its limits. Move the test pose, or check the compliances that the \
            compensation rests on.";
        TaskUnidentifiable = "C0305", "test pose depends on unidentifiable parameters",
            "The deflection at a test pose depends on parameters that were not determined. They keep their nominal values, and no accuracy \
            is predicted. Measure configurations and loads that determine them.";
        Unreachable = "C0306", "target out of reach",
            "For a target no joint angles were found within limits: it is too far, the inverse kinematics did not converge, or there is no \
            equilibrium. The others are commanded. Check frame, tool and unit of the targets.";
        OtherScenario = "C0307", "identified under another scenario",
            "The planner's model has changed since the identification: masses, gravity, nominal compliances, the calibration tool or the \
            instrument's sigma, by their hash in the file. Identify again under this scenario.";
        NoFingerprint = "C0308", "identification of unknown origin",
            "The identified file has no hash of robot and scenario, as files of earlier versions have none. It cannot be checked that it \
            belongs to this robot. Identify again under this scenario.";
        ToleranceExceeded = "C0309", "measurement beyond the tolerance",
            "A measurement differs from its prediction by more than the tolerance plus the guard band (JCGM 106: reject). The identified \
            robot does not keep the tolerance there: identify anew with configurations near these, or look for what has changed.";
        Inconclusive = "C0310", "tolerance within the guard band",
            "A measurement's distance from its prediction is within the guard band of the tolerance (JCGM 106): it can be neither accepted \
            nor rejected with the measurement's expanded uncertainty. Measure with a smaller uncertainty, or repeat.";
        FailedRuns = "C0401", "failed runs",
            "Some simulated runs gave no result; the first reason of each kind is given with its count. Statistics are over the \
            others, which are not a random choice. Look at one with `replay`.";
        PredictionExceeded = "C0402", "residual error exceeds the predicted accuracy",
            "The rms residual error of simulated robots is above the predicted one by more than three standard errors and 2 %. \
            Something in the simulated truth is not in the planner's model; the parts say how much each costs.";
        NotReproduced = "C0403", "published number not reproduced",
            "A number of the paper that should follow from its equations differs from this program's by more than its printing explains. \
            The page shows both.";
        BeyondTolerance = "C0404", "change beyond tolerance",
            "A number of the new results is worse than that of the base by more than the scenario's [gate] tolerates. \
            Find what changed, or make the new results the base.";
        InconclusiveChange = "C0405", "change within the guard band",
            "A mean of the new results is worse than that of the base, and its uncertainty leaves open whether by more than the tolerance of \
            [gate] (JCGM 106: inconclusive). Run more trials.";
        SmallDeflection = "C0501", "deflection below the noise",
            "The task load moves the tool at a test pose by less than sigma of the instrument: there is nothing to compensate that could be \
            measured. The usual cause is a load in another unit (kN).";
        UpwardLoad = "C0502", "loads point upwards",
            "More than 70 % of each allowed force points against gravity, where no weight pulls. Check the sign of the load: z is up.";
        ImpossibleMass = "C0503", "centre of mass far from its joint",
            "The centre of mass of a link lies further from its joint than twice the arm's reach. The usual cause are lengths in \
            millimetres: MJCF has metres.";
        NoEquilibrium = "C0504", "no static equilibrium at a test pose",
            "The robot does not hold its own weight or the task load at a test pose: its joints are too soft. The usual cause are \
            stiffnesses that are gains for simulation, or in another unit. Commands that predict an accuracy refuse the scenario.";
        NotWritten = "C0601", "file not written",
            "An output could not be written; results do not depend on it, and are printed and in the other files. Files that are named as \
            from before are older than this result. Make room or choose another place, and run the command again.";
    }
}
