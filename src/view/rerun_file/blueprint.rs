//! How the viewer shows a recording: the robot large, text and curves beside it.
//!
//! The archetypes are logged directly: the SDK's own blueprint types come with all of its other crates.

use re_sdk_types::AsComponents;
use re_sdk_types::blueprint::archetypes::{
    Background, ContainerBlueprint, EyeControls3D, LineGrid3D, PanelBlueprint, PlotLegend,
    ScalarAxis, TimeAxis, TimePanelBlueprint, ViewBlueprint, ViewContents, ViewportBlueprint,
};
use re_sdk_types::blueprint::components::{
    ActiveTab, BackgroundKind, ColumnShare, ContainerKind, Corner2D, IncludedContent, PanelState,
    PlayState, QueryExpression, RootContainer, RowShare, ViewClass,
};
use re_sdk_types::components::{Name, Visible};
use re_sdk_types::datatypes::{
    Bool, Float32, Range1D, TimeInt, TimeRange, TimeRangeBoundary, Uuid,
};

use super::store::Store;

/// A part of the window.
pub(super) enum ViewArea {
    /// Areas side by side, with their shares of the width.
    Row(Vec<(f32, ViewArea)>),
    /// Areas below one another, with their shares of the height.
    Column(Vec<(f32, ViewArea)>),
    /// Areas of which one is seen at a time.
    Tabs(Vec<ViewArea>),
    /// A view of a kind with its name and the entities that it shows, one a line.
    View(&'static str, String, String),
    /// Curves over the timeline with their name, the entities, one a line, and the range of values (lowest, highest) that
    /// is shown; if not given, what there is.
    Curves(String, String, Option<[f64; 2]>),
}

/// The kinds of views.
pub(super) const SPACE: &str = "3D";
pub(super) const PLANE: &str = "2D";
pub(super) const TEXT: &str = "TextDocument";
const CURVES: &str = "TimeSeries";
pub(super) const BARS: &str = "BarChart";

/// The timeline that is shown at first.
pub(super) struct Clock {
    /// Its name.
    pub(super) timeline: &'static str,
    /// The range that curves are drawn over; if not given, what there is.
    pub(super) range: Option<(i64, i64)>,
    /// How far it goes in a second when it is played.
    pub(super) per_second: f64,
    /// Whether it is played from the beginning, or stays at the end as that moves.
    pub(super) play_state: PlayState,
}

/// Writes the blueprint into its store; scenes are seen from a place (m) that looks at another.
pub(super) fn lay_out(
    store: &mut Store,
    root: &ViewArea,
    clock: &Clock,
    eye_m: Option<[[f32; 3]; 2]>,
) {
    let mut layout = Layout {
        store,
        eye_m,
        range: clock.range,
        count: 0,
    };
    let (_, id) = layout.add(root);
    let viewport = ViewportBlueprint::new()
        .with_root_container(RootContainer(Uuid { bytes: id }))
        .with_auto_layout(false)
        .with_auto_views(false);
    layout.log("viewport", &viewport);
    let hidden = PanelBlueprint::new().with_state(PanelState::Hidden);
    layout.log("blueprint_panel", &hidden);
    layout.log("selection_panel", &hidden);
    let time_panel = TimePanelBlueprint::new()
        .with_state(PanelState::Collapsed)
        .with_timeline(clock.timeline)
        .with_fps(clock.per_second)
        .with_play_state(clock.play_state);
    layout.log("time_panel", &time_panel);
}

struct Layout<'a> {
    store: &'a mut Store,
    eye_m: Option<[[f32; 3]; 2]>,
    range: Option<(i64, i64)>,
    count: u8,
}

impl Layout<'_> {
    fn log(&mut self, path: &str, what: &dyn AsComponents) {
        self.store.log(path, &[("blueprint", 0)], what);
    }

    /// Adds an area with all that is in it; gives its path in the blueprint and its identifier.
    fn add(&mut self, area: &ViewArea) -> (String, [u8; 16]) {
        self.count += 1;
        let mut id = [0; 16];
        // The viewer wants identifiers to look random (version 4).
        (id[0], id[6], id[8]) = (self.count, 0x40, 0x80);
        let text = format!("{:02x}000000-0000-4000-8000-000000000000", self.count);
        let path = match area {
            ViewArea::View(class, name, content) => {
                let path = format!("view/{text}");
                self.add_view(&path, class, name, content);
                path
            }
            ViewArea::Curves(name, content, values) => {
                let path = format!("view/{text}");
                self.add_view(&path, CURVES, name, content);
                self.add_axes(&path, *values);
                path
            }
            ViewArea::Row(areas) | ViewArea::Column(areas) => {
                let path = format!("container/{text}");
                let content = self.add_all(areas.iter().map(|(_, area)| area));
                let shares = areas.iter().map(|(share, _)| Float32(*share));
                let container = if matches!(area, ViewArea::Row(_)) {
                    ContainerBlueprint::new(ContainerKind::Horizontal)
                        .with_contents(content)
                        .with_col_shares(shares.map(ColumnShare))
                } else {
                    ContainerBlueprint::new(ContainerKind::Vertical)
                        .with_contents(content)
                        .with_row_shares(shares.map(RowShare))
                };
                self.log(&path, &container);
                path
            }
            ViewArea::Tabs(areas) => {
                let path = format!("container/{text}");
                let content = self.add_all(areas);
                let first = content[0].clone();
                let container = ContainerBlueprint::new(ContainerKind::Tabs)
                    .with_contents(content)
                    .with_active_tab(ActiveTab(first.0));
                self.log(&path, &container);
                path
            }
        };
        (path, id)
    }

    fn add_all<'a>(
        &mut self,
        areas: impl IntoIterator<Item = &'a ViewArea>,
    ) -> Vec<IncludedContent> {
        (areas.into_iter())
            .map(|area| IncludedContent(self.add(area).0.as_str().into()))
            .collect()
    }

    fn add_axes(&mut self, path: &str, values: Option<[f64; 2]>) {
        let legend = PlotLegend::new().with_corner(Corner2D::RightTop);
        self.log(&format!("{path}/PlotLegend"), &legend);
        if let Some((start, end)) = self.range {
            let boundary = |place| TimeRangeBoundary::Absolute(TimeInt(place));
            let range = TimeRange {
                start: boundary(start),
                end: boundary(end),
            };
            let axis = TimeAxis::new().with_view_range(range);
            self.log(&format!("{path}/TimeAxis"), &axis);
        }
        if let Some(values) = values {
            let axis = ScalarAxis::new().with_range(Range1D(values));
            self.log(&format!("{path}/ScalarAxis"), &axis);
        }
    }

    fn add_view(&mut self, path: &str, class: &'static str, name: &str, content: &str) {
        let origin = match content.split_once('\n') {
            None => content.trim_end_matches("/**"),
            Some(_) => "/",
        };
        let view = ViewBlueprint::new(ViewClass(class.into()))
            .with_display_name(Name(name.into()))
            .with_space_origin(origin)
            .with_visible(Visible(Bool(true)));
        self.log(path, &view);
        let contents = ViewContents::new(content.lines().map(|line| QueryExpression(line.into())));
        self.log(&format!("{path}/ViewContents"), &contents);
        if class == SPACE {
            let background =
                Background::new(BackgroundKind::SolidColor).with_color([222, 228, 234]);
            self.log(&format!("{path}/Background"), &background);
            let grid = LineGrid3D::new().with_visible(false);
            self.log(&format!("{path}/LineGrid3D"), &grid);
            if let Some([from, to]) = self.eye_m {
                let eye = EyeControls3D::new()
                    .with_position(from)
                    .with_look_target(to);
                self.log(&format!("{path}/EyeControls3D"), &eye);
            }
        }
    }
}

/// The range about nought that shows values of up to a size and has ticks that the viewer writes numbers at, which are powers of
/// ten apart: up to 1, 2, 3 or 10 of them, and a little more, so that the last is within.
pub(super) fn about_nought(largest: f64) -> Option<[f64; 2]> {
    if !(largest.is_normal() && largest > 0.0) {
        return None;
    }
    let power = 10_f64.powf(largest.log10().floor());
    let times = (largest / power).ceil();
    let end = if times > 3.0 { 10.0 } else { times } * power * 1.08;
    Some([-end, end])
}

#[cfg(test)]
mod tests {
    use super::about_nought;

    #[test]
    fn axes_end_at_numbers_that_can_be_read() {
        for (largest, end) in [
            (0.079, 0.1),
            (0.031, 0.1),
            (0.03, 0.03),
            (1.0, 1.0),
            (1.01, 2.0),
            (950.0, 1000.0),
            (2e-7, 2e-7),
        ] {
            let [low, high] = about_nought(largest).unwrap_or_default();
            assert!((high / end - 1.08).abs() < 1e-9, "{largest}: {high}");
            assert!(high > largest && low.to_bits() == (-high).to_bits());
        }
        for nothing in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(about_nought(nothing), None);
        }
    }
}
