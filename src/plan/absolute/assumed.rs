//! What predictions of absolute readings leave out, by its names.

use super::AbsolutePlanning;
use crate::parameter::ParameterKind;

impl AbsolutePlanning<'_> {
    /// What a prediction takes for certain although the scenario says that it is not, or although nobody reads it, in words.
    pub fn assumed_exact(&self) -> Vec<String> {
        let mut words = Vec::new();
        if !self.unasked.is_empty() {
            let names = self.unasked.join(", ");
            words.push(format!(
                "{names}, which robot.parameters names and --parameters does not"
            ));
        }
        if let Some(machining) = self.unread() {
            words.push(format!(
                "where {machining} is on its link, which no candidate reads"
            ));
        }
        let calibration = &self.case.belief.calibration_tool.name;
        let hanging = self.places_of_loads();
        words.extend(hanging.map(|name| format!("{name}, of where loads hang on {calibration}")));
        let is_drift = |kind: ParameterKind| matches!(kind, ParameterKind::Drift { .. });
        let drifts = self.sources_of(is_drift);
        words.extend(drifts.map(|name| format!("{name}, which is of deflections")));
        words
    }

    /// The names of the sources of where loads hang that the planner's model does not have, where no reading finds the calibration tool.
    pub fn places_of_loads(&self) -> impl Iterator<Item = &str> {
        let is_read = (self.case.targets).contains(&self.case.belief.calibration_tool.name);
        let mut setups = self.case.observations.iter().map(|each| &each.setup);
        let hangs = !is_read && setups.any(|setup| setup.hook().is_some());
        let is_place = |kind| matches!(kind, ParameterKind::ToolPosition { .. });
        self.sources_of(is_place).filter(move |_| hangs)
    }

    /// What the scenario says of frames, which readings alone find: a prediction does not count it.
    pub fn not_counted(&self) -> Vec<String> {
        let names = self.sources_of(|kind| self.case.kind_here(kind).is_none());
        names
            .map(|name| format!("{name}, of frames, which the readings alone find"))
            .collect()
    }

    /// The names of the sources of whose parameters some are such.
    fn sources_of(&self, is_such: impl Fn(ParameterKind) -> bool) -> impl Iterator<Item = &str> {
        let extended = &self.case.belief.uncertain;
        let parameters = extended.set().parameters();
        let such = extended
            .shared()
            .iter()
            .filter(move |(_, places)| places.iter().any(|&place| is_such(parameters[place].kind)));
        such.map(|(name, _)| name.as_str())
    }

    /// The names of the joints' errors that the robot keeps.
    pub(super) fn kept_errors(&self) -> Vec<String> {
        let sources = self.case.belief.uncertain.sources();
        let kept = sources.filter(|(_, source)| source.is_function());
        kept.map(|(name, _)| name.to_owned()).collect()
    }

    /// The machining tool, where no candidate reads it.
    pub(super) fn unread(&self) -> Option<&str> {
        let machining = &self.case.belief.machining_tool.name;
        (!self.case.targets.contains(machining)).then_some(machining)
    }
}
