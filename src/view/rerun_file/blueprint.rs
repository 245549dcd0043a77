//! How the viewer shows a recording: the robot large, text and curves beside it.

use nalgebra::Vector3;
use re_sdk::blueprint::components::{BackgroundKind, Corner2D, PanelState, PlayState};
use re_sdk::blueprint::{
    BarChartView, Blueprint, BlueprintActivation, BlueprintPanel, ContainerLike, SelectionPanel,
    Spatial3DView, TextDocumentView, TimePanel, TimeSeriesView,
};
use re_sdk::log::LogMsg;
use re_sdk::{
    AsComponents, EntityPath, RecordingStream, RecordingStreamBuilder, SerializedComponentBatch,
};
use re_sdk_types::blueprint::archetypes::{
    Background, EyeControls3D, LineGrid3D, PlotLegend, TimeAxis,
};
use re_sdk_types::datatypes::{TimeInt, TimeRange, TimeRangeBoundary};

use super::{Logged, new_stream, scene};

/// The timeline that is shown at first.
pub(super) struct Clock {
    /// Its name.
    pub(super) timeline: &'static str,
    /// The range that curves are drawn over.
    pub(super) range: [usize; 2],
    /// How far it goes in a second when it is played.
    pub(super) per_second: f64,
    /// Whether it is played from the beginning, or stays at the end as that moves.
    pub(super) play_state: PlayState,
}

/// What a layout's views have beside what the SDK's types of them take.
pub(super) struct Layout<'a> {
    pub(super) clock: &'a Clock,
    /// From where (m) scenes are seen, and the place to look at.
    pub(super) eye_m: Option<[Vector3<f64>; 2]>,
    pub(super) properties: Vec<(EntityPath, Vec<SerializedComponentBatch>)>,
}

impl Layout<'_> {
    fn set(&mut self, view: &ContainerLike, name: &str, what: &dyn AsComponents) {
        if let ContainerLike::View(view) = view {
            let path = view.blueprint_path().join(&EntityPath::from(name));
            self.properties.push((path, what.as_serialized_batches()));
        }
    }

    /// The robot.
    pub(super) fn space(&mut self) -> ContainerLike {
        let view = Spatial3DView::new("robot").with_origin("world").into();
        let background = Background::new(BackgroundKind::SolidColor).with_color([222, 228, 234]);
        self.set(&view, "Background", &background);
        let grid = LineGrid3D::new().with_visible(false);
        self.set(&view, "LineGrid3D", &grid);
        if let Some(places) = self.eye_m {
            let [from, to] = places.map(|place| scene::single(&place));
            let eye = EyeControls3D::new()
                .with_position(from)
                .with_look_target(to);
            self.set(&view, "EyeControls3D", &eye);
        }
        view
    }

    /// Curves over the whole timeline.
    pub(super) fn curves(&mut self, name: &str, origin: impl Into<EntityPath>) -> ContainerLike {
        let view = TimeSeriesView::new(name).with_origin(origin).into();
        let legend = PlotLegend::new().with_corner(Corner2D::RightTop);
        self.set(&view, "PlotLegend", &legend);
        let [start, end] = (self.clock.range).map(|place| {
            let place = i64::try_from(place).unwrap_or(i64::MAX);
            TimeRangeBoundary::Absolute(TimeInt(place))
        });
        let axis = TimeAxis::new().with_view_range(TimeRange { start, end });
        self.set(&view, "TimeAxis", &axis);
        view
    }

    /// Bars of these entities.
    pub(super) fn bars(&mut self, name: &str, shown: Vec<String>) -> ContainerLike {
        let view = BarChartView::new(name).with_contents(shown).into();
        let legend = PlotLegend::new().with_corner(Corner2D::LeftTop);
        self.set(&view, "PlotLegend", &legend);
        view
    }

    /// Sends the layout with all that is in it.
    pub(super) fn send(self, root: ContainerLike, stream: &RecordingStream) -> Logged {
        // Where the environment switches the SDK off (`RERUN=off`) it panics here. The viewer has a layout of its own.
        if !re_sdk::decide_logging_enabled(true) {
            return Ok(());
        }
        let time_panel = TimePanel::new()
            .with_state(PanelState::Collapsed)
            .with_timeline(self.clock.timeline)
            .with_fps(self.clock.per_second)
            .with_play_state(self.clock.play_state);
        let blueprint = Blueprint::new(root)
            .with_auto_layout(false)
            .with_auto_views(false)
            .with_blueprint_panel(BlueprintPanel::from_state(PanelState::Hidden))
            .with_selection_panel(SelectionPanel::from_state(PanelState::Hidden))
            .with_time_panel(time_panel);
        // The viewer takes over what is there when the last message comes: the properties are put before it.
        let (sketch, memory) = new_stream().memory()?;
        blueprint.send(&sketch, BlueprintActivation::default())?;
        let mut messages = memory.take();
        sketch.disconnect();
        messages.retain(|message| message.store_id().is_blueprint());
        let Some(LogMsg::BlueprintActivationCommand(activation)) = messages.pop() else {
            return Ok(());
        };
        let id = &activation.blueprint_id;
        let builder = RecordingStreamBuilder::from_store_id(id).enabled(true);
        let (sketch, memory) = builder.send_properties(false).memory()?;
        sketch.set_time_sequence("blueprint", 0);
        for (path, property) in self.properties {
            sketch.log_serialized_batches(path, false, property)?;
        }
        messages.extend(memory.take());
        sketch.disconnect();
        stream.send_blueprint(messages, activation);
        Ok(())
    }
}

/// A text in Markdown.
pub(super) fn text(name: &str, origin: &str) -> ContainerLike {
    TextDocumentView::new(name).with_origin(origin).into()
}
