//! Stable codes of conditions and errors. What they mean is told by the pages `docs/conditions.md` and `docs/errors.md` alone.
//!
//! The first two digits are the area. A code keeps its meaning: one that is no longer needed is not given again.

/// An enum of codes: name and id.
macro_rules! codes {
    ($(#[$about:meta])* $type:ident { $($name:ident = $id:literal,)* }) => {
        $(#[$about])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[derive(serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
        pub enum $type {
            $(#[doc = $id] #[serde(rename = $id)] $name,)*
        }

        impl $type {
            /// All codes, by their ids.
            pub const ALL: &[Self] = &[$(Self::$name,)*];

            /// The code, such as "C0102".
            pub const fn id(self) -> &'static str {
                match self {
                    $(Self::$name => $id,)*
                }
            }
        }

        impl std::fmt::Display for $type {
            fn fmt(&self, text: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                text.pad(self.id())
            }
        }
    };
}

mod condition;

pub use condition::Condition;

use serde::Serialize;

codes! {
    /// What can speak against a result that is there, and what somebody must look at before relying on it (exit code 3).
    ConditionCode {
        PlanUnidentifiable = "C0101",
        Violation = "C0102",
        NearConfigurations = "C0103",
        NoGain = "C0104",
        LoadOutside = "C0105",
        SearchStopped = "C0106",
        OutOfReach = "C0107",
        NoWay = "C0108",
        OneSidedApproach = "C0109",
        NoProgram = "C0110",
        BelowBound = "C0111",
        LargeDeflection = "C0112",
        NotMadeUp = "C0113",
        StaysBetweenVisits = "C0114",
        DriftIntervals = "C0115",
        Unidentifiable = "C0201",
        ImpossibleCompliance = "C0202",
        NegativeCompliance = "C0203",
        AllUncertain = "C0204",
        ResidualsTooLarge = "C0205",
        ResidualsTooSmall = "C0206",
        Outliers = "C0207",
        CopiedRows = "C0208",
        CopiedReadings = "C0209",
        InputError = "C0210",
        AnglesOutsideLimits = "C0211",
        ControllerCompensates = "C0212",
        Inconsistency = "C0213",
        GeometryBeyondTolerance = "C0214",
        FarFromPrior = "C0215",
        UnknownApproach = "C0216",
        SameJointErrors = "C0217",
        PredictionFailed = "C0301",
        Coverage = "C0302",
        StationMoved = "C0303",
        BeyondLimits = "C0304",
        TaskUnidentifiable = "C0305",
        Unreachable = "C0306",
        OtherScenario = "C0307",
        NoFingerprint = "C0308",
        ToleranceExceeded = "C0309",
        Inconclusive = "C0310",
        BeyondRead = "C0311",
        FailedRuns = "C0401",
        PredictionExceeded = "C0402",
        NotReproduced = "C0403",
        BeyondTolerance = "C0404",
        InconclusiveChange = "C0405",
        SmallDeflection = "C0501",
        UpwardLoad = "C0502",
        ImpossibleMass = "C0503",
        NoEquilibrium = "C0504",
        NotWritten = "C0601",
    }
}

codes! {
    /// What keeps a command from giving a result. An error about a file has the code that its origin gives it, else that of the
    /// reader of its kind of file.
    ErrorCode {
        Scenario = "E0101",
        OtherAccuracy = "E0102",
        ScenarioOfFile = "E0103",
        Model = "E0201",
        ModelFormat = "E0202",
        ModelName = "E0203",
        ModelStatics = "E0204",
        NotSerial = "E0205",
        ModelNotWritten = "E0206",
        NoEquilibrium = "E0207",
        Table = "E0301",
        Measurements = "E0302",
        Mapping = "E0303",
        PlanFile = "E0304",
        CandidateFile = "E0305",
        Targets = "E0306",
        NoPlan = "E0401",
        AbsolutePlan = "E0402",
        Campaign = "E0403",
        Program = "E0404",
        NothingIdentified = "E0501",
        NotConverged = "E0502",
        AbsoluteFit = "E0503",
        Frames = "E0504",
        IdentifiedFile = "E0505",
        OtherRobot = "E0506",
        Unreadable = "E0601",
        NotText = "E0602",
        NotWritable = "E0603",
        Overwrites = "E0604",
        OtherVersion = "E0605",
        Content = "E0606",
        Tally = "E0701",
        Simulation = "E0702",
        NotComparable = "E0703",
        Other = "E0901",
        Usage = "E0902",
    }
}

/// The pages that say what codes mean: paragraphs `**C0102 title.** Explanation.`
const PAGES: [&str; 2] = [
    include_str!("../../docs/conditions.md"),
    include_str!("../../docs/errors.md"),
];
/// So many codes are named where one is not known.
const NAMED: usize = 3;

/// What a code means.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Meaning {
    /// The code, such as "C0102".
    pub id: &'static str,
    /// What it is about, in a few words.
    pub title: &'static str,
    /// What was found, by which computation and with which threshold, and what to do.
    pub explanation: String,
}

/// The meanings of all codes: conditions, then errors.
pub fn meanings() -> impl Iterator<Item = Meaning> {
    let paragraphs = PAGES.into_iter().flat_map(|page| page.split("\n\n"));
    paragraphs.filter_map(|paragraph| {
        let (code, explanation) = paragraph.strip_prefix("**")?.split_once(".**")?;
        let (id, title) = code.split_once(' ')?;
        Some(Meaning {
            id,
            title,
            explanation: explanation.trim().replace('\n', " "),
        })
    })
}

/// The meanings of the codes that begin so, in capitals or not: of one, of an area, of all conditions ("C") or errors ("E").
///
/// # Errors
/// There is no such code: which are nearest to it.
pub fn meanings_of(word: &str) -> Result<Vec<Meaning>, String> {
    let wanted = word.trim().to_uppercase();
    let found = meanings().filter(|each| !wanted.is_empty() && each.id.starts_with(&wanted));
    let found: Vec<Meaning> = found.collect();
    if found.is_empty() {
        return Err(unknown(&wanted, meanings().collect()));
    }
    Ok(found)
}

/// The code of a condition, in capitals or not.
///
/// # Errors
/// There is no such code: which are nearest to it.
pub fn condition_code(word: &str) -> Result<ConditionCode, String> {
    let wanted = word.trim().to_uppercase();
    let mut all = ConditionCode::ALL.iter().copied();
    all.find(|code| code.id() == wanted).ok_or_else(|| {
        let conditions = meanings().filter(|each| each.id.starts_with('C'));
        unknown(&wanted, conditions.collect())
    })
}

fn unknown(wanted: &str, mut near: Vec<Meaning>) -> String {
    let alike = |id: &str| {
        let pairs = id.chars().zip(wanted.chars());
        pairs.take_while(|(one, other)| one == other).count()
    };
    near.sort_by_key(|each| {
        let changes = strsim::levenshtein(each.id, wanted);
        (changes, std::cmp::Reverse(alike(each.id)))
    });
    let near: Vec<String> = (near.iter().take(NAMED))
        .map(|each| format!("{} ({})", each.id, each.title))
        .collect();
    format!("there is no such code; the nearest are {}", near.join(", "))
}
