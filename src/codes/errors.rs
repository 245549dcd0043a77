//! The table of errors.
//!
//! An error about a file has the code that its origin gives it, else that of the reader of its kind of file.

codes! {
    /// What keeps a command from giving a result.
    ErrorCode {
        Scenario = "E0101", "invalid scenario",
            "The scenario is no TOML, has an unknown key, or a value that is not allowed; key and line are named. `elastocal schema` \
            has all keys, with which editors check them; `elastocal check` says how a scenario was understood.";
        OtherAccuracy = "E0102", "not for this kind of accuracy or readings",
            "The command or option is for deflections and the input for absolute accuracy, or the other way round: design.accuracy of \
            the scenario, or the columns of the measurement file, decide. Leave the option out, or use the command that the hint names.";
        ScenarioOfFile = "E0103", "scenario of an input file",
            "No scenario was given, and the input file names none, or one that has changed since. No other scenario is \
            taken for somebody's file: name the scenario after the command.";
        Model = "E0201", "model not loaded",
            "MuJoCo refuses the model, or it must not be loaded: broken XML, missing meshes, sizes beyond the limits. The message is MuJoCo's own.";
        ModelFormat = "E0202", "model in another format",
            "The file is no MJCF, or names its files as other formats do. `elastocal init` reads URDF and writes a scenario for it.";
        ModelName = "E0203", "name that the model does not have",
            "A site, body or joint of this name is not in the model; those that are there are listed. Tools are marked by sites, or mounted \
            by [[robot.tool]].";
        ModelStatics = "E0204", "model feature that the statics do not have",
            "The model has an element that can move the arm's static equilibrium and that the planner's model does not know. \
            It is refused and not ignored: take it out, or use the model for the simulated truth only (true_robot.model).";
        NotSerial = "E0205", "no serial arm",
            "Hinges and slides from the base to the tool must be one series, passive joints and springs beside them apart. The message names \
            the joint or body in the way.";
        ModelNotWritten = "E0206", "calibrated model cannot be written",
            "The identified parameters cannot be written into a model of this format so that MuJoCo reads the same robot from it. \
            The message says what is in the way.";
        NoEquilibrium = "E0207", "no static equilibrium",
            "Under gravity and load the joints do not come to rest within 0.5 rad, or nothing holds a joint. The usual causes are \
            stiffnesses that are gains of a simulation, or compliances or loads in another unit.";
        Table = "E0301", "table cannot be read",
            "The CSV file has other columns than are needed, rows of another length, a field that is no number, or one that can be read in two ways \
            (decimal comma). Line and column are named.";
        Measurements = "E0302", "invalid measurements",
            "The table is well formed, and a row cannot be a measurement: columns that come together, a standard deviation of zero, a \
            quaternion that is none, rows that belong together and differ. The line is named.";
        Mapping = "E0303", "table and mapping do not fit",
            "`import` finds no such column, unit or convention, or a number that is out of range once it is converted. Key or line are named.";
        PlanFile = "E0304", "invalid plan file",
            "A row is no experiment: repeats below 1, no load, a side of approach that is none; or the plan has too many measurements.";
        CandidateFile = "E0305", "invalid candidates or test poses",
            "A row is no candidate or test pose: columns of a load that come together, a target or station that is not there, too many rows.";
        Targets = "E0306", "invalid targets",
            "A row of `compensate --targets` is no position or pose, or tool, station or frame of the targets are not those of the robot.";
        NoPlan = "E0401", "no plan",
            "No experiment is feasible, feasible ones do not determine what the test poses need, or the criterion has no optimum to search. \
            Widen the region or the loads, take parameters out, or choose from candidates.";
        AbsolutePlan = "E0402", "no plan of absolute readings",
            "Candidates, targets or stations are not possible, or do not determine the tool's place at the test poses. \
            Offer more configurations, targets or stations.";
        Campaign = "E0403", "no way for the robot",
            "No collision-free way was found to an experiment, or its approach is beyond a joint's range, with the clearances of \
            [laboratory]. Name safe poses, or move the experiment.";
        Program = "E0404", "no such robot program",
            "There is no dialect of this name, its file is invalid, or it is for another number of axes. --dialect lists those that come along.";
        NothingIdentified = "E0501", "nothing identified",
            "There are no measurements, none depends on a parameter, or as many equations as unknowns leave no residual from which sigma \
            could be estimated. Measure more.";
        NotConverged = "E0502", "fit does not converge",
            "Gauss-Newton did not converge from the nominal values. The usual cause is an input error: check signs, units and frames, \
            or try --method linear.";
        AbsoluteFit = "E0503", "no fit of absolute readings",
            "Positions do not fit the robot in any frame, targets are not on it, or a number that is needed is not given. The usual cause is an \
            input error: order, sign and unit of the joint angles, unit of positions.";
        Frames = "E0504", "frames not determined",
            "The readings do not determine where stations and targets are: too few, or configurations that differ too little. \
            Read more configurations in which all joints differ.";
        IdentifiedFile = "E0505", "invalid identified file",
            "The file is none that `identify --identified-out` wrote, or has been changed: numbers that are inconsistent, \
            a covariance that is none. Identify again.";
        OtherRobot = "E0506", "identified with another robot",
            "Joints, axes or parameters in the identified file are not those of the scenario. Give the scenario under which it was \
            identified, or identify again.";
        Unreadable = "E0601", "file cannot be read",
            "The file is missing, a folder or device, too large, or may not be read. Paths inside a scenario are relative to its folder.";
        NotText = "E0602", "no text",
            "The file is not UTF-8 (for tables: nor UTF-16), such as one that a spreadsheet has saved in its own encoding. Save it as UTF-8.";
        NotWritable = "E0603", "file cannot be written",
            "The folder is missing, the file or folder may not be written, or the disk is full. That is found before the work begins, where it can be.";
        Overwrites = "E0604", "output over an input",
            "Two outputs are the same file, or an output is a file that is read: nothing is overwritten. Give another file, or another folder with --out.";
        OtherVersion = "E0605", "file of another version",
            "The file was written by a version of elastocal with another form of results. Read it with that version, or make it anew.";
        Content = "E0606", "invalid file",
            "The content of a file is none that the command takes; the message says what was found and what is allowed.";
        Tally = "E0701", "tally of another study",
            "A tally is damaged or not complete, comes twice, or is of another study, scenario, seed or shard. Make its part of the study again.";
        Simulation = "E0702", "simulation without result",
            "An experiment cannot be measured on the simulated robot, or a plan fails in every run; the first reason is named.";
        NotComparable = "E0703", "results that cannot be compared",
            "The files answer different questions, or have no number in common. Make both in the same way, or name what may differ with --allow-different.";
        Draws = "E0704", "file of random numbers",
            "The file of --draws-in is no list of random numbers, or is of another command, seed or number of runs. Write it anew with --draws-out.";
        View = "E0801", "nothing to view",
            "There is no recording, the file is none, or no rerun viewer was found. `run` and `study` write recordings; ELASTOCAL_RERUN \
            names the viewer.";
        Other = "E0901", "other error",
            "None of the other kinds, such as a closed stdout; the message says what is wrong.";
        Usage = "E0902", "wrong usage",
            "A command, option or value of the command line is none that there is. `elastocal help` lists the commands, \
            `elastocal COMMAND --help` the options of one. The exit code is 2.";
    }
}
